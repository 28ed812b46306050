"""A shop made ready for the inner loops: travel inside blocks folded into durations, chains of
operations merged, components found.

A *component* is a set of blocks that depend on each other both ways (a strongly connected component
of the precedence between blocks), as the blocks of two machines that meet do. Machines take whole
components in one order, which keeps them from waiting for each other in a circle: everything that
a component waits for stands before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import inf
from typing import NamedTuple

from fleet.jobshop.merging import Row, merged, with_chains
from fleet.jobshop.problem import Position, Shop, topological


class MergedOperation(NamedTuple):
    """An operation of an instance: one of the shop's, or several that always follow each other."""

    number: int
    block: int
    predecessors: tuple[int, ...]
    opens: tuple[int, ...]
    """Blocks that begin with it: their machines must be free."""
    closes: tuple[int, ...]
    """Blocks that end with it: their machines become free."""
    duration_s: tuple[float, ...]
    target: int
    arrives: int
    """Sites, or -1."""
    tail_s: float
    """No schedule ends earlier than this after the operation's end [s]."""
    weight: float
    due_s: float


class Instance:
    """The shop as numbers.

    Raises:
        BadShop: operations wait for each other in a circle.
    """

    def __init__(self, shop: Shop) -> None:
        self.shop = shop
        self.kinds = [machine.kind for machine in shop.machines]
        self.positions = [int(block.position) for block in shop.blocks]
        predecessors = with_chains(shop)
        owner, self.predecessors, rows = merged(shop, predecessors, topological(predecessors))
        count = len(rows)
        self.order = topological(self.predecessors)
        self.durations_s = [row.duration_s for row in rows]
        self.block_of = [row.blocks[0] for row in rows]
        self.blocks_of = [row.blocks for row in rows]
        self.targets = [row.target for row in rows]
        self.successors: list[list[int]] = [[] for _ in range(count)]
        for operation, befores in enumerate(self.predecessors):
            for before in befores:
                self.successors[before].append(operation)
        self.operations_of = [
            tuple(dict.fromkeys(owner[op] for op in block.operations)) for block in shop.blocks
        ]
        self.eligible_kinds = [
            tuple(sorted({self.kinds[m] for m in block.machines})) for block in shop.blocks
        ]
        self.least_s: list[float] = []
        """Of each operation, without travel to it."""
        mean_s: list[float] = []
        for row in rows:
            able_s = [row.duration_s[kind] for kind in self.eligible_kinds[row.blocks[0]]]
            self.least_s.append(min(able_s))
            mean_s.append(sum(able_s) / len(able_s))
        self.tails_s = [0.0] * count
        self.ranks_s = [0.0] * count
        """Upward ranks: the mean time from an operation's start to the end of all that follows."""
        for op in reversed(self.order):
            after = self.successors[op]
            self.tails_s[op] = max((self.tails_s[n] + self.least_s[n] for n in after), default=0.0)
            self.ranks_s[op] = mean_s[op] + max((self.ranks_s[n] for n in after), default=0.0)
        self._find_components(rows)
        self._find_sites(rows)
        self.weight_sum = sum(row.weight for row in rows) or 1.0
        self.has_due = any(row.due_s < inf for row in rows)
        self.travels = any(target >= 0 for target in self.targets)
        self.has_positions = any(p != Position.ANYWHERE for p in self.positions)

    @cached_property
    def whole(self) -> bool:
        """Whether all times are whole seconds, so that every makespan is."""
        return all(
            time == int(time)
            for times in (
                *self.durations_s,
                *(row for rows in self.shop.travel_s for row in rows),
                [machine.ready_s for machine in self.shop.machines],
            )
            for time in times
        )

    def _find_components(self, rows: Sequence[Row]) -> None:
        block_predecessors: list[set[int]] = [set() for _ in self.shop.blocks]
        for op, befores in enumerate(self.predecessors):
            for block in self.blocks_of[op]:
                block_predecessors[block].update(self.blocks_of[op])
                for before in befores:
                    block_predecessors[block].update(self.blocks_of[before])
        for block, others in enumerate(block_predecessors):
            others.discard(block)
        self.component_of = _strong_components(block_predecessors)
        count = max(self.component_of, default=-1) + 1
        self.component_blocks: list[list[int]] = [[] for _ in range(count)]
        self.component_predecessors: list[set[int]] = [set() for _ in range(count)]
        self.component_successors: list[set[int]] = [set() for _ in range(count)]
        for block, component in enumerate(self.component_of):
            self.component_blocks[component].append(block)
            for other in map(self.component_of.__getitem__, block_predecessors[block]):
                if other != component:
                    self.component_predecessors[component].add(other)
                    self.component_successors[other].add(component)
        first = [operations[0] for operations in self.operations_of]
        last = [operations[-1] for operations in self.operations_of]
        self.component_operations: list[list[MergedOperation]] = [[] for _ in range(count)]
        """In topological order."""
        for op in self.order:
            row = rows[op]
            self.component_operations[self.component_of[row.blocks[0]]].append(
                MergedOperation(
                    op,
                    row.blocks[0],
                    tuple(self.predecessors[op]),
                    tuple(b for b in row.blocks if first[b] == op),
                    tuple(b for b in row.blocks if last[b] == op),
                    row.duration_s,
                    row.target,
                    row.arrives,
                    self.tails_s[op],
                    row.weight,
                    row.due_s,
                )
            )
        self.component_rank_s = [
            max(self.ranks_s[op.number] for op in operations)
            for operations in self.component_operations
        ]
        self.several = {c for c, blocks in enumerate(self.component_blocks) if len(blocks) > 1}
        """Components of more than one block."""
        self.component_position = [
            max(self.positions[b] for b in blocks) for blocks in self.component_blocks
        ]
        rank = {op: i for i, op in enumerate(self.order)}
        for blocks in self.component_blocks:
            blocks.sort(key=lambda block: rank[first[block]])
        self.cannot_precede = [self._cannot_precede(b) for b in range(len(self.shop.blocks))]
        """Blocks of the same component that cannot stand before a block on the same machine."""

    def _find_sites(self, rows: Sequence[Row]) -> None:
        own = [
            [rows[op] for op in operations if rows[op].blocks[0] == block]
            for block, operations in enumerate(self.operations_of)
        ]
        self.entry = [next((r.target for r in mine if r.target >= 0), -1) for mine in own]
        """Where a block's machine drives first, or -1."""
        self.exit_of = [
            next((r.arrives for r in reversed(mine) if r.arrives >= 0), -1) for mine in own
        ]
        """Where a block leaves its machine; -1 where it does not move it."""
        self.exits = sorted({row.arrives for row in rows if row.arrives >= 0})
        """Sites where some operation leaves a machine."""
        self.own_s = [
            tuple(map(sum, zip(*(row.duration_s for row in mine), strict=True))) for mine in own
        ]
        """By machine kind, what a block's own operations take; empty for one that only helps."""

    def length_s(self, block: int, machine: int) -> float:
        """What a block's own operations take on a machine, travel to the first one not included."""
        own_s = self.own_s[block]
        return own_s[self.kinds[machine]] if own_s else 0.0

    def least_travel_s(self) -> list[float]:
        """Of every operation the least travel to its target: from where one of its machines starts,
        or from where some operation can leave one of them."""
        from_exits: dict[tuple[int, tuple[int, ...]], float] = {}
        found = [0.0] * len(self.targets)
        for op, target in enumerate(self.targets):
            if target < 0:
                continue
            block = self.block_of[op]
            key = (target, self.eligible_kinds[block])
            if key not in from_exits:
                from_exits[key] = min(
                    (self.shop.travel_s[k][site][target] for k in key[1] for site in self.exits),
                    default=inf,
                )
            found[op] = from_exits[key]
            if found[op] > 0:
                starts = {(self.kinds[m], self.shop.machines[m].site)
                          for m in self.shop.blocks[block].machines}  # fmt: skip
                least_s = min(self.shop.travel_s[kind][site][target] for kind, site in starts)
                found[op] = min(found[op], least_s)
        return found

    def _cannot_precede(self, block: int) -> frozenset[int]:
        """Those of which some operation comes after some operation of the block."""
        component = self.component_of[block]
        if len(self.component_blocks[component]) == 1:
            return frozenset()
        reached = set(self.operations_of[block])
        found: set[int] = set()
        for op in self.component_operations[component]:
            if op.number in reached or not reached.isdisjoint(op.predecessors):
                reached.add(op.number)
                found.update(self.blocks_of[op.number])
        return frozenset(found - {block})


def _strong_components(predecessors: Sequence[set[int]]) -> list[int]:
    """The strongly connected component of each node; without circles each is its own."""
    # Bit sets: of two nodes they are the same if each is reached from the other.
    reached, before = [1 << node for node in range(len(predecessors))], list[int]()
    while reached != before:
        before = list(reached)
        for node, others in enumerate(predecessors):
            for other in others:
                reached[node] |= reached[other]
    label: dict[int, int] = {}
    return [label.setdefault(bits, len(label)) for bits in reached]
