"""A shop made ready for the inner loops: legs inside blocks folded in, chains merged, knots found.

A *knot* is a set of blocks that depend on each other both ways, as the blocks of two robots that
meet do. Machines take whole knots in one order, which keeps them from waiting for each other in a
circle: everything that a knot waits for stands before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

from fleet.jobshop.graphs import strong_components
from fleet.jobshop.merging import Row, merged, single, with_chains
from fleet.jobshop.problem import Place, Shop, topological


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
        befores = with_chains(shop)
        order = topological(befores)
        owner, befores, rows = merged(shop, befores, order) if merge else single(shop, befores)
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

    def _knots(self, rows: Sequence[Row]) -> None:
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

    def least_ways_s(self) -> list[float]:
        """Of every step the least way to its target: from where one of its machines starts, or from
        where some step can leave one of them."""
        from_exits: dict[tuple[int, tuple[int, ...]], float] = {}
        ways = [0.0] * len(self.targets)
        for step, target in enumerate(self.targets):
            if target < 0:
                continue
            block = self.block_of[step]
            key = (target, self.eligible_kinds[block])
            if key not in from_exits:
                from_exits[key] = min(
                    (self.shop.travel_s[k][site][target] for k in key[1] for site in self.exits),
                    default=inf,
                )
            ways[step] = from_exits[key]
            if ways[step] > 0:
                starts = {(self.kinds[m], self.shop.machines[m].site)
                          for m in self.shop.blocks[block].machines}  # fmt: skip
                least = min(self.shop.travel_s[kind][site][target] for kind, site in starts)
                ways[step] = min(ways[step], least)
        return ways

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
