"""Plan repair: a running plan goes on with its residual plan, as far as that still works.

Planning a thousand tasks again takes long, and would turn over what is well under way. So the
residual plan is checked as it stands; goals that it no longer serves (a cup is elsewhere, a lost
robot had it in its hand, the goal is new) are planned anew, alone, and put beside the rest. The
checker decides whether that is a plan.
"""

from __future__ import annotations

from dataclasses import replace

from fleet.core.checker.checked_plan import CheckedPlan, check_plan
from fleet.core.revision.repair import beside, broken_goals, for_goals, without_tasks_of
from fleet.planners.base import NoPlan, Planner, PlanningProblem
from fleet.planners.oversubscription import PartialPlan, plan_reachable_goals
from keyexpr_schema.payloads.plans import Plan


def repair_plan(
    residual: Plan,
    problem: PlanningProblem,
    planner: Planner,
    feasibility: Planner,
    reached: frozenset[str],
) -> PartialPlan | None:
    """The residual plan, with the goals that it no longer serves planned anew; `None` if that is
    no plan.

    `problem` has all goals of the plan with what they still want; `reached` are those that want
    only to be kept. `feasibility` says which goals cannot be reached at all.
    """
    whole = for_goals(residual, problem.goals)
    checked = check_plan(whole, problem.world)
    if isinstance(checked, CheckedPlan):
        return PartialPlan(checked, changed=False)
    broken = broken_goals(checked, problem.goals)
    rest = tuple(goal for goal in problem.goals if goal.goal not in broken)
    if not broken or all(goal.goal in reached for goal in rest):
        return None
    numbers = [int(task.task.removeprefix("t")) for task in residual.tasks]
    first = max([problem.first_task, *(number + 1 for number in numbers)])
    anew = tuple(goal for goal in problem.goals if goal.goal in broken)
    part = plan_reachable_goals(
        planner, feasibility, replace(problem, goals=anew, first_task=first)
    )
    repaired = without_tasks_of(residual, broken)
    if isinstance(part, NoPlan):
        left_out = {goal.goal: part.reason for goal in anew}
    else:
        left_out = dict(part.left_out)
        repaired = beside(repaired, part.plan)
    repaired = for_goals(repaired, [g for g in problem.goals if g.goal not in left_out])
    rechecked = check_plan(repaired, problem.world)
    return PartialPlan(rechecked, left_out) if isinstance(rechecked, CheckedPlan) else None
