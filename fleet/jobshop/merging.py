"""Operations that always follow each other on the same machines merged into one; travel inside a
block made part of the duration.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

from fleet.jobshop.problem import BadShop, Shop


class Row(NamedTuple):
    """An operation, or several merged. Durations are by machine kind; sites may be -1: none."""

    blocks: tuple[int, ...]
    duration_s: tuple[float, ...]
    target: int
    arrives: int
    weight: float
    due_s: float


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


def _rows(shop: Shop) -> list[Row]:
    """Of each operation; the travel between two operations of a block is part of the duration."""
    rows = [
        Row(o.blocks, o.duration_s, -1 if o.target is None else o.target,
            -1 if o.arrives is None else o.arrives, o.weight, o.due_s)
        for o in shop.operations
    ]  # fmt: skip
    for number, block in enumerate(shop.blocks):
        site = -1
        for op in block.operations:
            row = rows[op]
            if row.blocks[0] != number:
                continue
            if row.target >= 0 and site >= 0:
                lasts_s = tuple(
                    duration_s + shop.travel_s[kind][site][row.target]
                    for kind, duration_s in enumerate(row.duration_s)
                )
                rows[op] = row._replace(duration_s=lasts_s, target=-1)
            site = row.arrives if row.arrives >= 0 else site
    return rows


def merged(
    shop: Shop, predecessors: list[list[int]], order: Sequence[int]
) -> tuple[list[int], list[list[int]], list[Row]]:
    """For each operation of the shop the merged one; of those, what each waits for, and rows."""
    rows = _rows(shop)
    successors = [0] * len(rows)
    for befores in predecessors:
        for before in befores:
            successors[before] += 1
    owner = [-1] * len(rows)
    made: list[Row] = []
    made_predecessors: list[list[int]] = []
    for op in order:
        row, befores = rows[op], predecessors[op]
        if len(befores) == 1 and successors[befores[0]] == 1:
            number = owner[befores[0]]
            head = made[number]
            plain = head.weight == 0 and head.due_s == inf
            if (
                plain
                and rows[befores[0]].blocks == row.blocks
                and (row.target < 0 or head.target < 0)
            ):
                owner[op] = number
                made[number] = row._replace(
                    duration_s=tuple(
                        a + b for a, b in zip(head.duration_s, row.duration_s, strict=True)
                    ),
                    target=max(head.target, row.target),
                    arrives=row.arrives if row.arrives >= 0 else head.arrives,
                )
                continue
        owner[op] = len(made)
        made.append(row)
        made_predecessors.append(sorted({owner[before] for before in befores}))
    return owner, made_predecessors, made
