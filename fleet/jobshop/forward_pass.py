"""The forward pass: when everything starts and ends if machines take their blocks in some order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf
from typing import NamedTuple, Self

from fleet.jobshop.preprocessing import Instance, MergedOperation
from fleet.jobshop.problem import BadShop, Position, Schedule, Shop, topological

ENDS_WEIGHT = 1e-3
"""How much the weighted mean end counts beside the makespan: it decides between equal makespans and
gives a search a slope to follow."""
LATE_WEIGHT = 100.0
"""A second of lateness after a due time counts as so many seconds of makespan."""
LAST = int(Position.LAST)


class Solution(NamedTuple):
    """Components in order, a machine for every block, and what that comes to.

    `cost` is what searches minimise; `start_s` and `end_s` are by operation of the instance.
    """

    order: list[int]
    machine_of: list[int]
    cost: float
    makespan_s: float
    start_s: list[float]
    end_s: list[float]


class PartialSchedule:
    """What is placed so far; blocks that are not placed yet may have no machine (-1)."""

    def __init__(self, instance: Instance, machine_of: list[int] | None = None) -> None:
        """`machine_of` is used as it is, and not copied."""
        machines = instance.shop.machines
        self.instance = instance
        self.machine_of = [-1] * len(instance.shop.blocks) if machine_of is None else machine_of
        self.free_s = [machine.ready_s for machine in machines]
        self.site = [machine.site for machine in machines]
        self.position = [0] * len(machines)
        """Of the latest block on each machine."""
        self.start_s = [0.0] * len(instance.predecessors)
        self.end_s = [0.0] * len(instance.predecessors)
        self.bound_s = 0.0
        """No schedule that goes on from here is shorter."""
        self.late_s = 0.0
        self.weighted_s = 0.0
        """Sums over the operations placed so far: lateness, and weight times end."""

    def copy(self) -> Self:
        """The same, to go on from in another way."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        for name in ("machine_of", "free_s", "site", "position", "start_s", "end_s"):
            setattr(other, name, list(getattr(self, name)))
        return other

    def extend(self, components: Sequence[int], limit_s: float = inf) -> bool:
        """Place components one after the other; see `place`.

        Also `False` if blocks of one component on one machine would wait for each other in a
        circle.
        """
        operations, several = self.instance.component_operations, self.instance.several
        rows = (operations[c] if c not in several else self._operations(c) for c in components)
        return self.place(rows, limit_s)

    def place(self, rows: Iterable[Sequence[MergedOperation] | None], limit_s: float = inf) -> bool:
        """Append operations as early as their predecessors and machines allow.

        `False`, with the rest left out, if a block stands where it must not, if there are no
        operations in some row, or as soon as the makespan is sure to exceed `limit_s`.
        """
        instance, machine_of = self.instance, self.machine_of
        kinds, positions, travel_s = instance.kinds, instance.positions, instance.shop.travel_s
        free_s, site, start_s, end_s = self.free_s, self.site, self.start_s, self.end_s
        position = self.position if instance.has_positions else None
        bound_s, late_s, weighted_s = self.bound_s, self.late_s, self.weighted_s
        for operations in rows:
            if operations is None:
                return False
            for (
                number, block, predecessors, opens, closes,
                duration_s, target, arrives, tail_s, weight, due_s,
            ) in operations:  # fmt: skip
                time_s = 0.0
                for before in predecessors:
                    if end_s[before] > time_s:
                        time_s = end_s[before]
                for opened in opens:
                    machine = machine_of[opened]
                    if free_s[machine] > time_s:
                        time_s = free_s[machine]
                    if position is not None:
                        if position[machine] == LAST or position[machine] > positions[opened]:
                            return False
                        position[machine] = positions[opened]
                start_s[number] = time_s
                machine = machine_of[block]
                kind = kinds[machine]
                time_s += duration_s[kind]
                if target >= 0:
                    time_s += travel_s[kind][site[machine]][target]
                if arrives >= 0:
                    site[machine] = arrives
                end_s[number] = time_s
                if time_s + tail_s > bound_s:
                    bound_s = time_s + tail_s
                    if bound_s > limit_s:
                        return False
                if weight:
                    weighted_s += weight * time_s
                if time_s > due_s:
                    late_s += time_s - due_s
                for closed in closes:
                    free_s[machine_of[closed]] = time_s
        self.bound_s, self.late_s, self.weighted_s = bound_s, late_s, weighted_s
        return True

    def solution(self, order: list[int]) -> Solution:
        """With every component placed, in `order`."""
        makespan_s = max(self.end_s, default=0.0)
        ends = ENDS_WEIGHT * self.weighted_s / self.instance.weight_sum
        cost = makespan_s + ends + LATE_WEIGHT * self.late_s
        return Solution(order, self.machine_of, cost, makespan_s, self.start_s, self.end_s)

    def _operations(self, component: int) -> Sequence[MergedOperation] | None:
        """In an order in which blocks that share a machine come one after the other."""
        instance = self.instance
        operations = instance.component_operations[component]
        blocks = instance.component_blocks[component]
        if len({self.machine_of[block] for block in blocks}) < len(blocks):
            return _one_after_the_other(operations, blocks, self.machine_of)
        return operations


def evaluate(
    instance: Instance, order: list[int], machine_of: list[int], limit: float = inf
) -> Solution | None:
    """The solution if machines take components in this `order`, which must respect dependencies.

    `None` if machines would wait for each other, if a block stands where it must not, or as soon as
    the cost is sure to exceed `limit`. The lists are used as they are, and not copied.
    """
    partial = PartialSchedule(instance, machine_of)
    if not partial.extend(order, limit):
        return None
    found = partial.solution(order)
    return None if found.cost > limit else found


def _one_after_the_other(
    operations: Sequence[MergedOperation], blocks: Sequence[int], machine_of: Sequence[int]
) -> list[MergedOperation] | None:
    """A component's operations when several of its blocks share a machine; `None` on deadlock."""
    previous: dict[int, int] = {}
    latest: dict[int, int] = {}
    for block in blocks:
        machine = machine_of[block]
        if machine in latest:
            previous[block] = latest[machine]
        latest[machine] = block
    mine = {operation.number for operation in operations}
    done: set[int] = set()
    closed: set[int] = set()
    ordered: list[MergedOperation] = []
    rest = list(operations)
    while rest:
        waiting = []
        for operation in rest:
            if all(b in done or b not in mine for b in operation.predecessors) and all(
                previous.get(b, b) in closed or b not in previous for b in operation.opens
            ):
                ordered.append(operation)
                done.add(operation.number)
                closed.update(operation.closes)
            else:
                waiting.append(operation)
        if len(waiting) == len(rest):
            return None
        rest = waiting
    return ordered


def schedule_of(shop: Shop, order: Sequence[int], machine_of: Sequence[int]) -> Schedule | None:
    """The earliest schedule in which machines take blocks in `order`, whatever order that is.

    `None` if they would wait for each other. Positions are not looked at, and blocks that `order`
    leaves out take part in any number of operations at once.
    """
    operations, machines = shop.operations, shop.machines
    predecessors = [list(operation.after) for operation in operations]
    start_s = [0.0] * len(operations)
    latest: dict[int, int] = {}
    for block in order:
        machine = machine_of[block]
        for op in shop.blocks[block].operations:
            start_s[op] = max(start_s[op], machines[machine].ready_s)
            if machine in latest:
                predecessors[op].append(latest[machine])
            latest[machine] = op
    try:
        sequence = topological(predecessors)
    except BadShop:
        return None
    site = [machine.site for machine in machines]
    end_s = [0.0] * len(operations)
    for op in sequence:
        operation = operations[op]
        machine = machine_of[operation.blocks[0]]
        kind = machines[machine].kind
        start_s[op] = max([start_s[op], *(end_s[before] for before in predecessors[op])])
        end_s[op] = start_s[op] + operation.duration_s[kind]
        if operation.target is not None:
            end_s[op] += shop.travel_s[kind][site[machine]][operation.target]
        if operation.arrives is not None:
            site[machine] = operation.arrives
    return Schedule(tuple(machine_of), tuple(order), tuple(start_s), tuple(end_s))
