"""Oversubscription: a plan for those goals that can be reached, where not all can."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass, field, replace

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.planners.base import NoPlan, Planner, PlanningProblem
from fleet.planners.contradictions import contradictions, reasons_of
from keyexpr_schema.payloads.plans import Plan


@dataclass(frozen=True)
class PartialPlan:
    """A plan, and the goals that it leaves out, each with the reason.

    Goals in `left_out` cannot be reached; those `postponed` contradict others, or, if they are
    `not_in_time`, only took too long to plan for. `changed` is false for a residual plan that stays
    as it was.
    """

    checked: CheckedPlan
    left_out: Mapping[str, str] = field(default_factory=dict)
    postponed: Mapping[str, str] = field(default_factory=dict)
    not_in_time: tuple[str, ...] = ()
    changed: bool = True

    @classmethod
    def of(
        cls,
        checked: CheckedPlan,
        problem: PlanningProblem,
        left_out: Mapping[str, str] | None = None,
    ) -> PartialPlan:
        """A planner's answer to `problem`; goals that it does without were postponed."""
        planned = set(checked.plan.goals)
        late = tuple(goal.goal for goal in problem.goals if goal.goal not in planned)
        return cls(checked, left_out or {}, dict.fromkeys(late, problem.not_in_time), late)

    @property
    def plan(self) -> Plan:
        """The plan without its check."""
        return self.checked.plan

    @property
    def incomplete(self) -> bool:
        """Whether it does without some goals."""
        return bool(self.left_out or self.postponed)


def plan_reachable_goals(
    planner: Planner,
    feasibility: Planner,
    problem: PlanningProblem,
    reached: frozenset[str] = frozenset(),
) -> PartialPlan | NoPlan:
    """A plan for all goals, or else for all but those that `feasibility` cannot plan even alone,
    and those that contradict one before them.

    Goals that are `reached` stay in the plan, so that it does not undo them; a plan for nothing
    else is no plan. A goal that contradicts another is postponed: it can be reached later.
    """
    made = planner.plan(problem)
    if isinstance(made, CheckedPlan):
        return PartialPlan.of(made, problem)
    left_out: dict[str, str] = {}
    for goal in problem.goals if len(problem.goals) > 1 else ():
        if goal.goal not in reached and not problem.budget.over:
            alone = feasibility.plan(replace(problem, goals=(goal,)))
            if isinstance(alone, NoPlan) and not alone.postponed:
                left_out[goal.goal] = alone.reason
    remaining = _without(problem, left_out)
    if left_out and _any_wanted(remaining, reached):
        again = planner.plan(remaining)
        if isinstance(again, CheckedPlan):
            return PartialPlan.of(again, remaining, left_out)
        made = again
    if made.postponed or len(remaining.goals) < 2:
        return made
    against = contradictions(feasibility, remaining, reached)
    reasons = reasons_of(against, remaining)
    compatible = _without(remaining, against)
    if against and _any_wanted(compatible, reached):
        again = planner.plan(compatible)
        if isinstance(again, CheckedPlan):
            partial = PartialPlan.of(again, compatible, left_out)
            waiting = {goal: reasons[goal] for goal in against}
            return replace(partial, postponed={**partial.postponed, **waiting})
        made = again
    return replace(made, goal_reasons={**reasons, **left_out})


def _without(problem: PlanningProblem, goals: Container[str]) -> PlanningProblem:
    return replace(problem, goals=tuple(g for g in problem.goals if g.goal not in goals))


def _any_wanted(problem: PlanningProblem, reached: frozenset[str]) -> bool:
    return any(goal.goal not in reached for goal in problem.goals)
