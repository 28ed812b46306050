"""Strongly connected components."""

from __future__ import annotations

from collections.abc import Sequence


def strong_components(befores: Sequence[set[int]]) -> list[int]:
    """The strongly connected component of each node (Kosaraju, Sharir 1981), without recursion."""
    laters: list[list[int]] = [[] for _ in befores]
    for node, rows in enumerate(befores):
        for before in rows:
            laters[before].append(node)
    finished: list[int] = []
    seen = [False] * len(befores)
    for root in range(len(befores)):
        if seen[root]:
            continue
        seen[root] = True
        stack = [(root, iter(laters[root]))]
        while stack:
            node, rest = stack[-1]
            for after in rest:
                if not seen[after]:
                    seen[after] = True
                    stack.append((after, iter(laters[after])))
                    break
            else:
                finished.append(node)
                stack.pop()
    component = [-1] * len(befores)
    count = 0
    for root in reversed(finished):
        if component[root] >= 0:
            continue
        component[root] = count
        todo = [root]
        while todo:
            for before in befores[todo.pop()]:
                if component[before] < 0:
                    component[before] = count
                    todo.append(before)
        count += 1
    return component
