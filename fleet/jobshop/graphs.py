"""Strongly connected components, and the cheapest assignment."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf


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


def cheapest_assignment(costs: Sequence[Sequence[float]]) -> float:
    """The least total cost of giving every row a column of its own; there are enough columns.

    Shortest augmenting paths (Jonker, Volgenant 1987), in O(rows^2 * columns). SciPy has it faster,
    and takes half a second to import.
    """
    rows, columns = len(costs), len(costs[0])
    row_price, column_price = [0.0] * rows, [0.0] * columns
    row_of = [-1] * columns
    for start in range(rows):
        distance, came_from = [inf] * columns, [-1] * columns
        done = [False] * columns
        row, column, length = start, -1, 0.0
        while True:
            nearest, least = -1, inf
            for j in range(columns):
                if done[j]:
                    continue
                reach = length + costs[row][j] - row_price[row] - column_price[j]
                if reach < distance[j]:
                    distance[j], came_from[j] = reach, column
                if distance[j] < least:
                    nearest, least = j, distance[j]
            column, length = nearest, least
            done[column] = True
            if row_of[column] < 0:
                break
            row = row_of[column]
        row_price[start] += length
        for j in range(columns):
            if done[j] and j != column:
                row_price[row_of[j]] += length - distance[j]
                column_price[j] -= length - distance[j]
        while came_from[column] >= 0:
            row_of[column] = row_of[came_from[column]]
            column = came_from[column]
        row_of[column] = start
    return sum(costs[i][j] for j, i in enumerate(row_of) if i >= 0)
