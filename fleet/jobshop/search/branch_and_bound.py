"""Every schedule of a small shop, by depth-first branch and bound, component after component.

Its answer is the least makespan there is, the least late one where there are due times, and of
those the one whose weighted ends come first.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

from fleet.jobshop.forward_pass import LATE_WEIGHT, PartialSchedule, Solution
from fleet.jobshop.preprocessing import Instance

MOST_COMPONENTS = 7
MOST_NODES = 6000
"""Placements looked at before it is given up: about a quarter of a second."""


class Optimum(NamedTuple):
    """The best solution; `proven` if no schedule is shorter, in whatever order."""

    solution: Solution
    proven: bool


def branch_and_bound(
    instance: Instance, begin: Solution, most_nodes: int = MOST_NODES
) -> Optimum | None:
    """The best there is, or `None` if that would take too long. `begin` is some solution."""
    if len(instance.component_blocks) > MOST_COMPONENTS:
        return None
    search = _Search(instance, begin, most_nodes)
    if not search.run():
        return None
    return Optimum(search.found, _one_order(instance) and not instance.has_due)


def _one_order(instance: Instance) -> bool:
    """Whether no schedule is lost by all machines taking components in one order.

    A block that waits for one of two that meet can stand before the other one on its machine; and
    three that meet can be taken in different orders. So can what comes after the beginning of a
    block and what its end waits for. Otherwise machines would wait in a circle.
    """
    return all(
        (len(blocks) == 1 and _waits_before_it_gives(instance, blocks[0]))
        or (
            len(blocks) == 2
            and not instance.component_predecessors[component]
            and not instance.component_successors[component]
        )
        for component, blocks in enumerate(instance.component_blocks)
    )


def _waits_before_it_gives(instance: Instance, block: int) -> bool:
    """Whether no operation of another block comes after one of this, and before a later one."""
    mine = instance.operations_of[block]
    waits = [i for i, op in enumerate(mine) if not set(mine).issuperset(instance.predecessors[op])]
    gives = [i for i, op in enumerate(mine) if not set(mine).issuperset(instance.successors[op])]
    return not waits or not gives or waits[-1] <= gives[0]


class _Search:
    def __init__(self, instance: Instance, begin: Solution, most_nodes: int) -> None:
        self.instance = instance
        self.found = begin
        started = PartialSchedule(instance, begin.machine_of)
        started.extend(begin.order)
        self.best = _value(started)
        self.nodes, self.most_nodes = 0, most_nodes
        blocks = instance.shop.blocks
        self.alike = [
            tuple(machine in block.machines for block in blocks)
            for machine in range(len(instance.shop.machines))
        ]
        """Machines with the same row do the same blocks."""

    def run(self) -> bool:
        """Whether everything was looked at."""
        everything = frozenset(range(len(self.instance.component_blocks)))
        return self._extend(PartialSchedule(self.instance), [], everything)

    def _extend(self, partial: PartialSchedule, order: list[int], left: frozenset[int]) -> bool:
        if not left:
            self.best = _value(partial)
            self.found = partial.solution(order)
            return True
        for component in sorted(left, key=lambda k: -self.instance.component_rank_s[k]):
            if not self.instance.component_predecessors[component].isdisjoint(left):
                continue
            for machines in self._choices(partial, component):
                if self._swapped(partial, order, component, machines):
                    continue
                self.nodes += 1
                if self.nodes > self.most_nodes:
                    return False
                after = partial.copy()
                for block, machine in machines.items():
                    after.machine_of[block] = machine
                # Nothing shorter, or as short and earlier, can come of it otherwise.
                if not after.extend((component,), self.best[0]) or _value(after) >= self.best:
                    continue
                if not self._extend(after, [*order, component], left - {component}):
                    return False
        return True

    def _choices(self, partial: PartialSchedule, component: int) -> Iterator[dict[int, int]]:
        """Machines for the component's blocks; of machines that are alike now, one."""
        blocks = self.instance.component_blocks[component]
        shop = self.instance.shop
        seen: set[object] = set()
        for machines in product(*(shop.blocks[block].machines for block in blocks)):
            chosen = dict(zip(blocks, machines, strict=True))
            if any(
                chosen.get(other, partial.machine_of[other]) == machine
                for block, machine in chosen.items()
                for other in shop.blocks[block].apart
            ):
                continue
            looks = (
                tuple(self._looks(partial, machine) for machine in machines),
                tuple(machines.index(machine) for machine in machines),
            )
            if looks not in seen:
                seen.add(looks)
                yield chosen

    def _looks(self, partial: PartialSchedule, machine: int) -> object:
        """What a machine's future depends on; those that others keep apart from are unique."""
        blocks = self.instance.shop.blocks
        kept_apart = any(m == machine and blocks[b].apart for b, m in enumerate(partial.machine_of))
        return (
            self.alike[machine],
            self.instance.kinds[machine],
            partial.free_s[machine],
            partial.site[machine],
            partial.position[machine],
            machine if kept_apart else None,
        )

    def _swapped(
        self,
        partial: PartialSchedule,
        order: Sequence[int],
        component: int,
        machines: dict[int, int],
    ) -> bool:
        """Whether this is the schedule in which the component before comes after this one."""
        if (
            not order
            or component > order[-1]
            or order[-1] in self.instance.component_predecessors[component]
        ):
            return False
        before = {partial.machine_of[b] for b in self.instance.component_blocks[order[-1]]}
        return before.isdisjoint(machines.values())


def _value(partial: PartialSchedule) -> tuple[float, float]:
    return partial.bound_s + LATE_WEIGHT * partial.late_s, partial.weighted_s
