"""From operations to steps: ways inside blocks folded into durations, chains merged into one."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from fleet.jobshop.problem import BadShop, Shop

Row = tuple[tuple[int, ...], tuple[float, ...], int, int, float, float]
"""Blocks, durations by kind, target, arrives, weight, due."""


def with_chains(shop: Shop) -> list[list[int]]:
    """What each operation waits for, with the one before it in each of its blocks."""
    befores = [set(operation.after) for operation in shop.operations]
    for block in shop.blocks:
        for one, other in zip(block.operations, block.operations[1:], strict=False):
            befores[other].add(one)
    for number, rows in enumerate(befores):
        if not all(0 <= before < len(befores) for before in rows) or number in rows:
            raise BadShop(f"operation {number} waits for itself or for what does not exist")
    return [sorted(rows) for rows in befores]


def single(shop: Shop, befores: list[list[int]]) -> tuple[list[int], list[list[int]], list[Row]]:
    """Every operation a step of its own: owners, what each waits for, and rows."""
    return list(range(len(befores))), befores, _rows(shop)


def _rows(shop: Shop) -> list[Row]:
    """Of each operation; the way between two operations of a block is part of the duration."""
    rows: list[Row] = [
        (o.blocks, o.duration_s, -1 if o.target is None else o.target,
         -1 if o.arrives is None else o.arrives, o.weight, o.due_s)
        for o in shop.operations
    ]  # fmt: skip
    for number, block in enumerate(shop.blocks):
        where = -1
        for op in block.operations:
            mine, duration, target, arrives, weight, due = rows[op]
            if mine[0] != number:
                continue
            if target >= 0 and where >= 0:
                duration = tuple(
                    d + shop.travel_s[kind][where][target] for kind, d in enumerate(duration)
                )
                rows[op] = (mine, duration, -1, arrives, weight, due)
            where = arrives if arrives >= 0 else where
    return rows


def merged(
    shop: Shop, befores: list[list[int]], order: Sequence[int]
) -> tuple[list[int], list[list[int]], list[Row]]:
    """Merge operations that always follow each other directly on the same machines."""
    rows = _rows(shop)
    laters = [0] * len(rows)
    for before in befores:
        for b in before:
            laters[b] += 1
    owner = [-1] * len(rows)
    steps: list[Row] = []
    step_befores: list[list[int]] = []
    for op in order:
        row = rows[op]
        before = befores[op]
        if len(before) == 1 and laters[before[0]] == 1 and rows[before[0]][0] == row[0]:
            step = owner[before[0]]
            head = steps[step]
            free = head[4] == 0 and head[5] == inf and (row[2] < 0 or head[2] < 0)
            if free:
                owner[op] = step
                steps[step] = (
                    row[0],
                    tuple(a + b for a, b in zip(head[1], row[1], strict=True)),
                    max(head[2], row[2]),
                    row[3] if row[3] >= 0 else head[3],
                    row[4],
                    row[5],
                )
                continue
        owner[op] = len(steps)
        steps.append(row)
        step_befores.append(sorted({owner[b] for b in before}))
    return owner, step_befores, steps
