"""Schedules at once: list scheduling by upward rank, and dispatching rules between rank and
nearness.

Upward rank and earliest finish are HEFT (Topcuoglu, Hariri, Wu 2002). The dispatching rule takes,
of what is ready, the component with the least `start + travel - alpha · rank`: 0 is "what can start
first", a large alpha is list scheduling.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Sequence
from math import inf
from random import Random
from typing import NamedTuple

from fleet.jobshop.forward_pass import LAST, PartialSchedule, Solution
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.time_budget import TimeBudget

ALPHAS = (0.1, 0.5, 1.0, 2.0, 0.2, 0.0, 0.3, 0.03, 0.7, 0.05, 0.4, 5.0)
"""Tried one after the other while there is time; spread around those that won most often."""
CANDIDATES = 48
"""Ready components that a dispatching rule looks at, those of highest rank."""
ALWAYS = 200
"""Operations up to which every rule is tried whatever the time: a few milliseconds each."""
AT_LEAST = 50
"""Tries at random of a small problem, where rules find nothing, whatever the time."""


def list_schedule(
    instance: Instance,
    alpha: float | None = None,
    at_random: Random | None = None,
    budget: TimeBudget | None = None,
) -> Solution | None:
    """Place one ready component after the other; without `alpha` the one of highest rank (HEFT).

    `at_random` takes any machine that will do, instead of the one where a block ends first.
    Deterministic. `None` if it leads to where some block finds no machine, or if the `budget` is
    over before it is done.
    """
    partial = GreedySchedule(instance, at_random)
    order: list[int] = []
    missing = [len(befores) for befores in instance.component_predecessors]
    ready: list[tuple[int, float, int]] = []
    expected: dict[int, Placement] = {}

    def is_ready(component: int) -> None:
        rank_s = instance.component_rank_s[component]
        insort(ready, (instance.component_position[component], -rank_s, component))

    for component, count in enumerate(missing):
        if count == 0:
            is_ready(component)
    while ready:
        if len(order) % 256 == 255 and budget is not None and budget.over:
            return None
        at = 0 if alpha is None else partial.choose(ready, expected, alpha)
        component = ready.pop(at)[2]
        expected.pop(component, None)
        if not partial.add(component):
            return None
        order.append(component)
        if alpha is not None:
            partial.update(expected, component)
        for later in instance.component_successors[component]:
            missing[later] -= 1
            if missing[later] == 0:
                is_ready(later)
    return partial.solution(order)


def dispatching_rules(
    instance: Instance, best: Solution | None, budget: TimeBudget
) -> Solution | None:
    """The best of `best` and dispatching rules, tried until the `budget` is over.

    Those that are tried at small sizes take no time worth counting.
    """
    for alpha in ALPHAS:
        small = len(instance.predecessors) <= ALWAYS
        if best is not None and not small and budget.over:
            break
        found = list_schedule(instance, alpha, budget=None if small or best is None else budget)
        if found is not None and (best is None or found.cost < best.cost):
            best = found
    return best


def random_restarts(instance: Instance, budget: TimeBudget, seed: int) -> Solution | None:
    """Some schedule where rules run into dead ends: blocks of a component in other orders, machines
    at random for one component after the other."""
    random = Random(seed)
    tries, least = 0, AT_LEAST if len(instance.predecessors) <= ALWAYS else 1
    while tries < least or not budget.over:
        tries += 1
        for together in instance.component_blocks:
            random.shuffle(together)
        found = list_schedule(instance, random.choice((None, *ALPHAS)), at_random=random)
        if found is not None:
            return found
    return None


class Placement(NamedTuple):
    """A machine for a block, and when it would start, after the travel, and finish there [s]."""

    finish_s: float
    start_s: float
    machine: int


class GreedySchedule(PartialSchedule):
    """Chooses a machine for every block as it is placed."""

    def __init__(self, instance: Instance, at_random: Random | None = None) -> None:
        super().__init__(instance)
        self.random = at_random
        self.eligible = [frozenset(block.machines) for block in instance.shop.blocks]

    def add(self, component: int) -> bool:
        """Place the component; `False` if one of its blocks has no machine, or on deadlock."""
        for block in self.instance.component_blocks[component]:
            found = self.best(block)
            if found is None:
                return False
            self.machine_of[block] = found.machine
        return self.extend((component,))

    def ready_s(self, block: int) -> float:
        """When what the block waits for, and is placed, has ended."""
        first = self.instance.operations_of[block][0]
        befores = self.instance.predecessors[first]
        return max((self.end_s[before] for before in befores), default=0.0)

    def placement(self, block: int, machine: int, ready_s: float) -> Placement:
        """The block on this machine."""
        instance = self.instance
        start_s = max(self.free_s[machine], ready_s)
        target = instance.entry[block]
        if target >= 0:
            kind = instance.kinds[machine]
            start_s += instance.shop.travel_s[kind][self.site[machine]][target]
        return Placement(start_s + instance.length_s(block, machine), start_s, machine)

    def allowed(self, block: int) -> Sequence[int]:
        """Machines that the block may be placed on now."""
        instance = self.instance
        row = instance.shop.blocks[block]
        others = {self.machine_of[other] for other in row.apart}
        others |= {self.machine_of[other] for other in instance.cannot_precede[block]}
        if not others and not instance.has_positions:
            return row.machines
        position = instance.positions[block]
        return [
            m
            for m in row.machines
            if m not in others and self.position[m] != LAST and self.position[m] <= position
        ]

    def best(self, block: int) -> Placement | None:
        """The machine on which the block ends first; of equals the one that idles least before."""
        machines = self.allowed(block)
        if not machines:
            return None
        ready_s = self.ready_s(block)
        machine = (
            self._first_done(block, machines, ready_s)
            if self.random is None
            else self.random.choice(machines)
        )
        return self.placement(block, machine, ready_s)

    def _first_done(self, block: int, machines: Sequence[int], ready_s: float) -> int:
        """`placement` for all machines, of which the least is taken: the innermost loop of all."""
        instance = self.instance
        kinds, free, site = instance.kinds, self.free_s, self.site
        own_s = instance.own_s[block] or (0.0,) * (max(kinds) + 1)
        target, travel_s = instance.entry[block], instance.shop.travel_s
        best, least_s, latest_s = -1, inf, -inf
        for machine in machines:
            free_s = free[machine]
            if free_s > least_s:
                continue
            kind = kinds[machine]
            finish_s = (free_s if free_s > ready_s else ready_s) + own_s[kind]
            if target >= 0:
                finish_s += travel_s[kind][site[machine]][target]
            if finish_s < least_s or (finish_s == least_s and free_s > latest_s):
                best, least_s, latest_s = machine, finish_s, free_s
        return best

    def choose(
        self,
        ready: Sequence[tuple[int, float, int]],
        expected: dict[int, Placement],
        alpha: float,
    ) -> int:
        """The index in `ready` of the component that the dispatching rule takes."""
        chosen, least = 0, inf
        first_position = ready[0][0]
        for index, (position, minus_rank_s, component) in enumerate(ready[:CANDIDATES]):
            if position > first_position:
                break
            found = expected.get(component)
            if found is None:
                found = self.best(self.instance.component_blocks[component][0])
                if found is None:
                    continue
                expected[component] = found
            score = found.start_s + alpha * minus_rank_s
            if score < least:
                chosen, least = index, score
        return chosen

    def update(self, expected: dict[int, Placement], placed: int) -> None:
        """Forget what is different now that a component is placed.

        A machine only gets busier, so a placement is as it was unless its machine, or a nearer one,
        is among those used.
        """
        used = {self.machine_of[block] for block in self.instance.component_blocks[placed]}
        for component, found in list(expected.items()):
            if found.machine in used:
                del expected[component]
                continue
            block = self.instance.component_blocks[component][0]
            if self.instance.entry[block] < 0:
                continue
            ready_s = self.ready_s(block)
            if any(
                self.placement(block, machine, ready_s).finish_s < found.finish_s
                for machine in used & self.eligible[block]
            ):
                del expected[component]
