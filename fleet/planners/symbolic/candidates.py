"""Candidates for a plan, and the best of them so far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf

from fleet.core.actors import carried_at_end
from fleet.core.checker.plan_checker import CheckedPlan
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.base import LEAST_WORK, NoPlan
from fleet.planners.symbolic.workloads import Choice as Choice
from fleet.planners.symbolic.workloads import unloading_s
from fleet.scheduling.plan_schedule import AllocatedPlan, PlanSchedule
from fleet.scheduling.quick_allocation import quick_allocation

REFINING_NODES = 3000
"""How long a better allocation is sought for a small plan."""

Cost = tuple[float, float]
"""The makespan [s], with a charge for what is left in baskets, and the work of all robots [s]; for
the least work the other way round."""


@dataclass(frozen=True)
class Candidate:
    """A valid plan for a choice of sequences, each actor with an able robot.

    Until it is verified, `cost` is that of the shortest schedule, which need not pass the checker.
    `crowded` is that of the choice's `Estimate`: with any, too few robots are left for it.
    """

    choice: Choice
    allocated: AllocatedPlan
    cost: Cost
    crowded: int = 0

    def refined(self) -> Candidate:
        """With a better allocation, if a look at all of a small plan's finds one."""
        checked = self.allocated.checked
        made = allocated_as(self.choice, checked, quick_allocation(checked, REFINING_NODES))
        if made is None or made.cost >= self.cost:
            return self
        return replace(made, crowded=self.crowded)

    def verified(self) -> Candidate | NoPlan:
        """With the cost of the shortest schedule that passes the checker."""
        found = self.allocated.valid_schedule()
        if isinstance(found, tuple):
            return NoPlan(found[0].sentence, found)
        return replace(self, cost=_cost(found, self.allocated.checked))


def allocated_as(
    choice: Choice, checked: CheckedPlan, allocation: Mapping[str, str] | None
) -> Candidate | None:
    """The candidate of a checked plan with this allocation, if there is one."""
    if allocation is None:
        return None
    allocated = AllocatedPlan(checked, allocation)
    schedule = next(allocated.schedules(), None)
    cost = (inf, inf) if schedule is None else _cost(schedule, checked)
    return Candidate(choice, allocated, cost)


def _cost(schedule: PlanSchedule, checked: CheckedPlan) -> Cost:
    left_s = unloading_s(checked.world) * len(carried_at_end(checked))
    makespan_s, work_s = schedule.makespan_s, sum(schedule.durations_s.values())
    if checked.plan.strategy == LEAST_WORK:
        return round(work_s + left_s, 3), makespan_s
    return round(makespan_s + left_s, 3), work_s


def by_cost(candidate: Candidate) -> tuple[int, Cost]:
    """To sort by."""
    return candidate.crowded, candidate.cost


class Best:
    """The cheapest valid candidate so far, and why the first that was not valid was not."""

    def __init__(self, begin: Candidate | None = None) -> None:
        self.found = begin
        self.failure: NoPlan | None = None

    def improved(self, candidate: Candidate | NoPlan) -> bool:
        """Whether the candidate is better; verifying does not make a plan cheaper, so only what
        looks cheaper is verified."""
        if isinstance(candidate, Candidate) and self._is_better(candidate):
            candidate = candidate.verified()
            if isinstance(candidate, Candidate) and self._is_better(candidate):
                self.found = candidate
                return True
        if isinstance(candidate, NoPlan):
            self.failure = self.failure or candidate
        return False

    def _is_better(self, candidate: Candidate) -> bool:
        return self.found is None or by_cost(candidate) < by_cost(self.found)

    @property
    def result(self) -> Candidate | NoPlan:
        """The best, or why there is none."""
        none = NoPlan("no combination of action sequences passes the checker")
        return self.found or self.failure or none


class Pace:
    """Whether there is time for one more plan, by what the last one took."""

    def __init__(self, budget: TimeBudget) -> None:
        self._budget = budget
        self._began = budget.spent
        self._share = 0.0

    def begin(self) -> None:
        """A plan is made now."""
        self._began = self._budget.spent

    def end(self) -> None:
        """It is made."""
        self._share = self._budget.spent - self._began

    @property
    def over(self) -> bool:
        """Whether another one would take too long."""
        return self._budget.spent + self._share >= 1.0
