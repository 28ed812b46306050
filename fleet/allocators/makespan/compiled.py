"""A shop made ready for the inner loops: legs inside blocks folded in, chains merged, knots found.

A *knot* is a set of blocks that depend on each other both ways, as the blocks of two robots that
meet do. Machines take whole knots in one order, which keeps them from waiting for each other in a
circle: everything that a knot waits for stands before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

from fleet.allocators.makespan.problem import BadShop, Place, Shop, topological


class Step(NamedTuple):
    """An operation, or several merged; all that the timetable asks of it."""

    number: int
    block: int
    befores: tuple[int, ...]
    opens: tuple[int, ...]
    """Blocks that begin with it: their machines must be free."""
    closes: tuple[int, ...]
    """Blocks that end with it: their machines become free."""
    duration_s: tuple[float, ...]
    target: int
    arrives: int
    """Sites, or -1."""
    tail_s: float
    """No schedule ends earlier than this after the step's end [s]."""
    weight: float
    due_s: float


class Compiled:
    """The shop as numbers. With `merge=False` steps are the shop's operations one by one.

    Raises:
        BadShop: operations wait for each other in a circle.
    """

    def __init__(self, shop: Shop, merge: bool = True) -> None:
        self.shop = shop
        self.kinds = [machine.kind for machine in shop.machines]
        self.places = [int(block.place) for block in shop.blocks]
        befores = _with_chains(shop)
        order = topological(befores)
        owner, befores, rows = _merged(shop, befores, order) if merge else _single(shop, befores)
        self.owner = owner
        """Step of each operation."""
        self.befores = befores
        count = len(befores)
        self.order = topological(befores)
        self.durations = [row[1] for row in rows]
        self.block_of = [row[0][0] for row in rows]
        self.blocks_of = [row[0] for row in rows]
        self.targets = [row[2] for row in rows]
        self.laters: list[list[int]] = [[] for _ in range(count)]
        for step, before in enumerate(befores):
            for b in before:
                self.laters[b].append(step)
        self.steps_of = [
            tuple(dict.fromkeys(owner[op] for op in block.operations)) for block in shop.blocks
        ]
        self.eligible_kinds = [
            tuple(sorted({self.kinds[m] for m in block.machines})) for block in shop.blocks
        ]
        self.least = [
            min(self.durations[s][k] for k in self.eligible_kinds[self.block_of[s]])
            for s in range(count)
        ]
        mean = [
            sum(self.durations[s][k] for k in self.eligible_kinds[self.block_of[s]])
            / len(self.eligible_kinds[self.block_of[s]])
            for s in range(count)
        ]
        self.tails = [0.0] * count
        self.ranks = [0.0] * count
        for step in reversed(self.order):
            rest = self.laters[step]
            self.tails[step] = max((self.tails[n] + self.least[n] for n in rest), default=0.0)
            self.ranks[step] = mean[step] + max((self.ranks[n] for n in rest), default=0.0)
        self._knots(rows)

    def _knots(self, rows: Sequence[_Row]) -> None:
        blocks = len(self.shop.blocks)
        before_blocks: list[set[int]] = [set() for _ in range(blocks)]
        for step, before in enumerate(self.befores):
            mine = self.blocks_of[step]
            for block in mine:
                before_blocks[block].update(mine)
                for b in before:
                    before_blocks[block].update(self.blocks_of[b])
        for block, rows_before in enumerate(before_blocks):
            rows_before.discard(block)
        self.knot_of = strong_components(before_blocks)
        count = max(self.knot_of, default=-1) + 1
        self.knot_blocks: list[list[int]] = [[] for _ in range(count)]
        for block, knot in enumerate(self.knot_of):
            self.knot_blocks[knot].append(block)
        self.knot_befores: list[set[int]] = [set() for _ in range(count)]
        self.knot_laters: list[set[int]] = [set() for _ in range(count)]
        for block, rows_before in enumerate(before_blocks):
            knot = self.knot_of[block]
            for other in rows_before:
                if self.knot_of[other] != knot:
                    self.knot_befores[knot].add(self.knot_of[other])
                    self.knot_laters[self.knot_of[other]].add(knot)
        first = [steps[0] for steps in self.steps_of]
        last = [steps[-1] for steps in self.steps_of]
        self.flow: list[list[Step]] = [[] for _ in range(count)]
        place = {step: i for i, step in enumerate(self.order)}
        for step in self.order:
            mine, duration, target, arrives, weight, due = rows[step]
            self.flow[self.knot_of[mine[0]]].append(
                Step(
                    step,
                    mine[0],
                    tuple(self.befores[step]),
                    tuple(b for b in mine if first[b] == step),
                    tuple(b for b in mine if last[b] == step),
                    duration,
                    target,
                    arrives,
                    self.tails[step],
                    weight,
                    due,
                )
            )
        self.knot_rank = [max(self.ranks[step.number] for step in flow) for flow in self.flow]
        self.knot_place = [max(self.places[b] for b in mine) for mine in self.knot_blocks]
        for together in self.knot_blocks:
            together.sort(key=lambda block: place[first[block]])
        self.entry = [
            next((rows[s][2] for s in steps if rows[s][0][0] == b and rows[s][2] >= 0), -1)
            for b, steps in enumerate(self.steps_of)
        ]
        """Where a block's machine drives first, or -1."""
        self.exit_of = [
            next(
                (rows[s][3] for s in reversed(steps) if rows[s][0][0] == b and rows[s][3] >= 0), -1
            )
            for b, steps in enumerate(self.steps_of)
        ]
        """Where a block leaves its machine; -1 where it does not move it."""
        self.exits = sorted({row[3] for row in rows if row[3] >= 0})
        """Sites where some step leaves a machine."""
        self.own_s = [
            tuple(map(sum, zip(*(rows[s][1] for s in steps if rows[s][0][0] == b), strict=True)))
            for b, steps in enumerate(self.steps_of)
        ]
        """By machine kind, what a block's own steps take; empty for one that only lends a hand."""
        self.not_ahead = [self._not_ahead(block) for block in range(blocks)]
        """Blocks of the same knot that cannot stand before a block on the same machine."""
        self.weight_sum = sum(row[4] for row in rows) or 1.0
        self.whole = all(
            time == int(time)
            for times in (
                *self.durations,
                *(row for rows in self.shop.travel_s for row in rows),
                [machine.ready_s for machine in self.shop.machines],
            )
            for time in times
        )
        """Whether all times are whole seconds, so that every makespan is."""
        self.has_due = any(row[5] < inf for row in rows)
        self.travels = any(target >= 0 for target in self.targets)
        self.has_places = any(p != Place.ANYWHERE for p in self.places)

    def least_ended(self, way_s: Sequence[float]) -> list[float]:
        """The least time of every step, with the least way of its block where it drives first."""
        return [
            least + (way_s[self.block_of[step]] if self.targets[step] >= 0 else 0.0)
            for step, least in enumerate(self.least)
        ]

    def shortest_way_s(self, block: int, target: int) -> float:
        """The least way to a site for a block: from where one of its machines starts, or from where
        some block, other than itself, can leave one of them."""
        machines = self.shop.blocks[block].machines
        best = inf
        for machine in machines:
            kind, site = self.kinds[machine], self.shop.machines[machine].site
            best = min(best, self.shop.travel_s[kind][site][target])
        for site in self.exits:
            for kind in self.eligible_kinds[block]:
                best = min(best, self.shop.travel_s[kind][site][target])
            if best <= 0:
                break
        return best

    def _not_ahead(self, block: int) -> frozenset[int]:
        """Those of which some step comes after some step of the block."""
        knot = self.knot_of[block]
        if len(self.knot_blocks[knot]) == 1:
            return frozenset()
        reached = set(self.steps_of[block])
        found: set[int] = set()
        for step in self.flow[knot]:
            if step.number in reached or not reached.isdisjoint(step.befores):
                reached.add(step.number)
                found.update(self.blocks_of[step.number])
        return frozenset(found - {block})


_Row = tuple[tuple[int, ...], tuple[float, ...], int, int, float, float]
"""Blocks, durations by kind, target, arrives, weight, due."""


def _with_chains(shop: Shop) -> list[list[int]]:
    """What each operation waits for, with the one before it in each of its blocks."""
    befores = [set(operation.after) for operation in shop.operations]
    for block in shop.blocks:
        for one, other in zip(block.operations, block.operations[1:], strict=False):
            befores[other].add(one)
    for number, rows in enumerate(befores):
        if not all(0 <= before < len(befores) for before in rows) or number in rows:
            raise BadShop(f"operation {number} waits for itself or for what does not exist")
    return [sorted(rows) for rows in befores]


def _single(shop: Shop, befores: list[list[int]]) -> tuple[list[int], list[list[int]], list[_Row]]:
    return list(range(len(befores))), befores, _rows(shop)


def _rows(shop: Shop) -> list[_Row]:
    """Of each operation; the way between two operations of a block is part of the duration."""
    rows: list[_Row] = [
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


def _merged(
    shop: Shop, befores: list[list[int]], order: Sequence[int]
) -> tuple[list[int], list[list[int]], list[_Row]]:
    """Merge operations that always follow each other directly on the same machines."""
    rows = _rows(shop)
    laters = [0] * len(rows)
    for before in befores:
        for b in before:
            laters[b] += 1
    owner = [-1] * len(rows)
    steps: list[_Row] = []
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
