"""A schedule repaired after a machine is lost or late, with few blocks changing machines.

Candidates: the old order gone through again for a range of targets, where every block stays that
does not keep the target from being met; the orphans put where there is time; a schedule from
scratch; and the best of those annealed. Of all that are within `WITHIN` of the shortest, the one
with the fewest moves is taken, moves that it can do without are taken back, and what time is left
goes into a search with a price on moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

from fleet.jobshop.bounds import lower_bound
from fleet.jobshop.forward_pass import Solution, evaluate
from fleet.jobshop.portfolio import schedule_in_order
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.problem import Position, Schedule, Shop
from fleet.jobshop.search.annealing import anneal
from fleet.jobshop.search.list_scheduling import list_schedule
from fleet.jobshop.search.warm_start import warm_start
from fleet.jobshop.time_budget import TimeBudget

WITHIN = 0.02
"""Share of the best makespan that fewer moves may cost."""
PRICE = 0.002
"""Share of the makespan that one move costs while annealing: ten moves for `WITHIN`."""
TARGETS = (1.0, 0.99, 0.98, 0.97, 0.995, 0.985, 0.975, 0.96, 0.95, 0.94)
"""Of the longest makespan that is allowed; tried one after the other."""
TARGETS_SHARE, ORPHANS_SHARE, SHORTEN_SHARE = 0.4, 0.5, 0.6
MORE_TARGETS_SHARE, TAKE_BACK_SHARE = 0.75, 0.85
"""When each stage is over, as a share of the time."""
TRIED = 4
"""Machines that are tried for an orphan: those that are done first."""


@dataclass(frozen=True)
class Rescheduled:
    """The schedule as it is now; `moved` are blocks that are not where they were.

    `best_makespan_s` is the shortest found whatever it moves.
    """

    schedule: Schedule
    moved: tuple[int, ...]
    best_makespan_s: float


def reschedule(
    shop: Shop,
    home: Sequence[int],
    order: Sequence[int],
    budget: TimeBudget,
    seed: int = 0,
) -> Rescheduled | None:
    """Repair the schedule `home` (machine of each block) and `order` (of blocks) for the `shop` as
    it is now.

    Blocks whose home is not among their machines any more are orphans. What is done is not in the
    shop, a block that is under way has one machine and is `Position.FIRST`, and a machine's
    `ready_s` says when it is free. `None` if no schedule was found.
    """
    instance = Instance(shop)
    search = _Rescheduling(instance, home, _components_in_order(instance, order), seed)
    if not search.begin(budget):
        return None
    search.keep_to_targets(budget.until(TARGETS_SHARE))
    search.place_orphans(budget.until(ORPHANS_SHARE))
    search.shorten(budget.until(SHORTEN_SHARE))
    search.keep_to_targets(budget.until(MORE_TARGETS_SHARE))
    chosen = search.move_less(budget.until(TAKE_BACK_SHARE), budget)
    schedule = schedule_in_order(instance, chosen)
    schedule = replace(schedule, lower_bound_s=lower_bound(instance))
    return Rescheduled(schedule, tuple(_moved(chosen.machine_of, home)), search.best_s)


class _Rescheduling:
    """Everything found so far, and ways to find more."""

    def __init__(
        self,
        instance: Instance,
        home: Sequence[int],
        order: list[int],
        seed: int,
    ) -> None:
        self.instance, self.home, self.order, self.seed = instance, home, order, seed
        self.found: list[Solution] = []
        self.kept: list[Solution] = []
        """Of those found, the ones that keep to a target."""
        self.targeted_s = 0.0
        """The limit that targets were last taken from."""

    @property
    def best_s(self) -> float:
        """The shortest makespan found, whatever it moves."""
        return min(solution.makespan_s for solution in self.found)

    @property
    def limit_s(self) -> float:
        """The longest makespan that fewer moves may lead to."""
        return self.best_s * (1 + WITHIN)

    def begin(self, budget: TimeBudget) -> bool:
        """From scratch, and with every block at home that can be; whether there is any schedule."""
        self._add(list_schedule(self.instance))
        self._add(warm_start(self.instance, self.order, self.home, inf))
        if not self.found:
            self.place_orphans(budget)
        return bool(self.found)

    def keep_to_targets(self, budget: TimeBudget) -> None:
        """Blocks stay where the target can be met so. Where there is travel, or blocks meet, that
        may miss it by a little, so that shorter ones are tried, too."""
        tried = 0
        while tried < len(TARGETS):
            if self.met and budget.over:
                break
            if self.limit_s != self.targeted_s:
                # The first time, or one of those before has come out shorter than all others.
                self.targeted_s, tried = self.limit_s, 0
            elif tried == 0:
                break
            target_s = TARGETS[tried] * self.targeted_s
            tried += 1
            made = warm_start(self.instance, self.order, self.home, target_s)
            if made is not None:
                self.found.append(made)
                self.kept.append(made)

    @property
    def met(self) -> bool:
        """Whether keeping to a target has led to a schedule that is short enough."""
        limit_s = self.limit_s
        return any(solution.makespan_s <= limit_s for solution in self.kept)

    def place_orphans(self, budget: TimeBudget) -> None:
        """Only orphans move."""
        self._add(_orphans_placed(self.instance, self.home, self.order, budget))

    def shorten(self, budget: TimeBudget) -> None:
        """Search for a shorter schedule at any number of moves, from one that has few: what comes
        out of a new one would set a limit that only new ones meet."""
        begin = self.kept if self.met else self.found
        shortest = min(begin, key=lambda solution: solution.makespan_s)
        self._add(anneal(self.instance, shortest, budget, 0.0, self.seed))

    def move_less(self, take_back: TimeBudget, budget: TimeBudget) -> Solution:
        """The solution with the fewest moves within the limit, and fewer if that can be."""
        chosen = self._chosen()
        chosen = _taken_back(self.instance, chosen, self.home, self.limit_s, take_back)
        self.found.append(chosen)
        price_s = PRICE * self.best_s
        seed = self.seed + 1
        self._add(anneal(self.instance, chosen, budget, 0.0, seed, price_s, self.home))
        return self._chosen()

    def _add(self, solution: Solution | None) -> None:
        if solution is not None:
            self.found.append(solution)

    def _chosen(self) -> Solution:
        limit_s = self.limit_s
        return min(
            (solution for solution in self.found if solution.makespan_s <= limit_s),
            key=lambda s: (len(_moved(s.machine_of, self.home)), s.makespan_s),
        )


def _moved(machine_of: Sequence[int], home: Sequence[int]) -> list[int]:
    return [b for b, (now, was) in enumerate(zip(machine_of, home, strict=True)) if now != was]


def _orphans_placed(
    instance: Instance, home: Sequence[int], order: list[int], budget: TimeBudget
) -> Solution | None:
    """Everything stays but the orphans, the one of highest rank first; they go where there is least
    to do, and while there is time, where the makespan is least."""
    blocks = instance.shop.blocks
    machine_of = list(home)
    orphans = [b for b, block in enumerate(blocks) if home[b] not in block.machines]
    orphans.sort(key=lambda b: -instance.component_rank_s[instance.component_of[b]])
    busy_s = [machine.ready_s for machine in instance.shop.machines]
    for block, machine in enumerate(home):
        if machine in blocks[block].machines:
            busy_s[machine] += instance.length_s(block, machine)
    for block in orphans:
        machine_of[block] = min(blocks[block].machines, key=busy_s.__getitem__)
        busy_s[machine_of[block]] += instance.length_s(block, machine_of[block])
    best = evaluate(instance, order, machine_of)
    for block in orphans:
        if budget.over:
            break
        now = machine_of[block]
        for machine in sorted(blocks[block].machines, key=busy_s.__getitem__)[:TRIED]:
            if any(machine_of[other] == machine for other in blocks[block].apart):
                continue
            machine_of[block] = machine
            found = evaluate(instance, order, machine_of, best.cost if best else inf)
            if found is not None and (best is None or found.cost < best.cost):
                length_s = instance.length_s(block, machine)
                busy_s[now] -= length_s
                busy_s[machine] += length_s
                best, now = found, machine
        machine_of[block] = now
    apart = any(machine_of[o] == machine_of[b] for b, row in enumerate(blocks) for o in row.apart)
    return None if best is None or apart else best._replace(machine_of=machine_of)


def _components_in_order(instance: Instance, order: Sequence[int]) -> list[int]:
    """Components in the order in which the last of their blocks begins, repaired where something
    that comes before stands behind; blocks that must be first come first, the others' order stays.
    """
    at = {block: i for i, block in enumerate(order)}
    key = {
        component: (
            instance.component_position[component] != Position.FIRST,
            max(at.get(b, len(at)) for b in blocks),
        )
        for component, blocks in enumerate(instance.component_blocks)
    }
    done: set[int] = set()
    result: list[int] = []
    for component in sorted(key, key=key.__getitem__):
        stack = [component]
        while stack:
            top = stack[-1]
            if top in done:
                stack.pop()
                continue
            waits = [k for k in instance.component_predecessors[top] if k not in done]
            if waits:
                stack.extend(waits)
            else:
                done.add(top)
                result.append(stack.pop())
    return result


def _taken_back(
    instance: Instance, begin: Solution, home: Sequence[int], limit_s: float, budget: TimeBudget
) -> Solution:
    """Moves undone one by one, as long as the makespan stays within the limit."""
    best = begin
    for block in _moved(begin.machine_of, home):
        row = instance.shop.blocks[block]
        if budget.over:
            break
        if home[block] not in row.machines or any(
            best.machine_of[other] == home[block] for other in row.apart
        ):
            continue
        machine_of = [*best.machine_of]
        machine_of[block] = home[block]
        found = evaluate(instance, best.order, machine_of)
        if found is not None and found.makespan_s <= limit_s:
            best = found
    return best
