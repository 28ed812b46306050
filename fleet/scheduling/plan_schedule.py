"""When a plan's tasks run under an allocation, and in which order each robot takes its actors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise

from fleet.core.checker.plan_checker import CheckedPlan, check_allocation
from fleet.jobshop.forward_pass import schedule_of
from fleet.jobshop.sequencing import sequences
from fleet.jobshop.time_budget import StepClock, TimeBudget
from fleet.scheduling.allocation_context import AllocationContext
from fleet.scheduling.plan_shop import plan_shop
from keyexpr_schema.payloads.plans import Violation

MAX_SEQUENCES_CHECKED = 24
"""Sequences put to the checker before an allocation is given up, the shortest first."""
QUICK_S, THOROUGH_S = 2.0**-6, 2.0**-2
"""Of a `StepClock`: some thirty moves to compare plans, a thousand to carry one out."""


@dataclass(frozen=True)
class PlanSchedule:
    """Predicted start and end of every task [s], with the order of actors on each robot.

    `extra_after` are the dependencies that follow from that order.
    """

    start_s: Mapping[str, float]
    end_s: Mapping[str, float]
    sequence: Mapping[str, tuple[str, ...]]
    extra_after: Mapping[str, tuple[str, ...]]

    @property
    def makespan_s(self) -> float:
        """When the last task ends."""
        return max(self.end_s.values(), default=0.0)

    @property
    def durations_s(self) -> dict[str, float]:
        """Of every task, with the travel to it."""
        return {task: end_s - self.start_s[task] for task, end_s in self.end_s.items()}


class AllocatedPlan:
    """A plan whose actors have robots, and the schedules that it can have."""

    def __init__(
        self,
        checked: CheckedPlan,
        allocation: Mapping[str, str],
        context: AllocationContext | None = None,
    ) -> None:
        self.checked, self.allocation = checked, allocation
        robot = {actor: (allocation[actor],) for actor in checked.plan.actors}
        self._shop = plan_shop(checked, robot, context=context)

    def schedule(self, actor_order: Sequence[str]) -> PlanSchedule | None:
        """The earliest one if robots take actors in this order; `None` on deadlock."""
        actors, shop, tasks = self._shop.actors, self._shop.shop, self._shop.tasks
        block_of = {actor: block for block, actor in enumerate(actors)}
        order = [block_of[actor] for actor in actor_order]
        machine_of = [block.machines[0] for block in shop.blocks]
        found = schedule_of(shop, order, machine_of)
        if found is None:
            return None
        by_robot: dict[str, list[int]] = {}
        for block in order:
            by_robot.setdefault(self._shop.robots[machine_of[block]], []).append(block)
        extra_after: dict[str, set[str]] = {}
        for row in by_robot.values():
            for one, later in pairwise(row):
                first = tasks[shop.blocks[later].operations[0]]
                extra_after.setdefault(first, set()).add(tasks[shop.blocks[one].operations[-1]])
        return PlanSchedule(
            dict(zip(tasks, found.start_s, strict=True)),
            dict(zip(tasks, found.end_s, strict=True)),
            {robot: tuple(actors[b] for b in row) for robot, row in by_robot.items()},
            {task: tuple(sorted(befores)) for task, befores in extra_after.items()},
        )

    def schedules(self, thorough: bool = False) -> Iterator[PlanSchedule]:
        """In various orders, the shortest first; none if all that were tried deadlock."""
        search_s = THOROUGH_S if thorough else QUICK_S
        actors = self._shop.actors
        for shop in self._shop.relaxed():
            for blocks in sequences(shop, TimeBudget(search_s, StepClock())):
                found = self.schedule([actors[b] for b in blocks if b < len(actors)])
                if found is not None:
                    yield found

    def valid_schedule(self, thorough: bool = False) -> PlanSchedule | tuple[Violation, ...]:
        """The shortest one that passes the checker with robots for actors, or what is wrong.

        Another order than the shortest may be the one that leaves every goal reached.
        """
        violations: tuple[Violation, ...] = ()
        for found in islice(self.schedules(thorough), MAX_SEQUENCES_CHECKED):
            violations = self.violations(found)
            if not violations:
                return found
        sentence = "with this allocation robots wait for each other for ever"
        return violations or (Violation(code="no-allocation", sentence=sentence),)

    def violations(self, schedule: PlanSchedule) -> tuple[Violation, ...]:
        """What the checker says with robots for actors, in this order."""
        plan, world = self.checked.plan, self.checked.world
        return check_allocation(plan, world, self.allocation, schedule.extra_after)
