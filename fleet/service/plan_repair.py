"""A running plan goes on with what is left of it, as far as that still works.

Planning a thousand tasks again takes long, and would turn over what is well under way. So what is
left is checked as it stands; goals for which it no longer works (a cup is elsewhere, a lost robot
had it in its hand, the goal is new) are planned anew, alone, and put beside the rest. The checker
decides whether that is a plan.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace as changed

from msgspec.structs import replace

from fleet.core.checker.checked_plan import CheckedPlan, InvalidPlan, check_plan
from fleet.planners.base import NoPlan, Planner, PlanningProblem
from fleet.service.oversubscription import PartialPlan, plan_what_can_be
from keyexpr_schema.facts import SEARCHED
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan


def mended_plan(
    remaining: Plan,
    problem: PlanningProblem,
    planner: Planner,
    judge: Planner,
    reached: frozenset[str],
) -> PartialPlan | None:
    """What is left of a plan, with the goals that it no longer serves planned anew; `None` if that
    is no plan.

    `problem` has all goals of the plan with what they still want; `reached` are those that want
    only to be kept. `judge` says which goals cannot be reached at all.
    """
    whole = _for_goals(remaining, problem.goals)
    checked = check_plan(whole, problem.world)
    if isinstance(checked, CheckedPlan):
        return PartialPlan(checked, changed=False)
    broken = _broken_goals(checked, problem.goals)
    rest = tuple(goal for goal in problem.goals if goal.goal not in broken)
    if not broken or all(goal.goal in reached for goal in rest):
        return None
    tasks = tuple(task for task in remaining.tasks if task.goal not in broken)
    kept = {task.task for task in tasks}
    numbers = [int(task.task.removeprefix("t")) for task in remaining.tasks]
    first = max([problem.first_task, *(number + 1 for number in numbers)])
    anew = tuple(goal for goal in problem.goals if goal.goal in broken)
    part = plan_what_can_be(planner, judge, changed(problem, goals=anew, first_task=first))
    mended = replace(
        remaining,
        tasks=tuple(replace(t, after=tuple(b for b in t.after if b in kept)) for t in tasks),
    )
    if isinstance(part, NoPlan):
        left_out = {goal.goal: part.reason for goal in anew}
    else:
        left_out = dict(part.left_out)
        mended = _beside(mended, part.plan)
    actors = {task.actor for task in mended.tasks}
    mended = _for_goals(
        replace(mended, pins={a: robot for a, robot in mended.pins.items() if a in actors}),
        [goal for goal in problem.goals if goal.goal not in left_out],
    )
    repaired = check_plan(mended, problem.world)
    return PartialPlan(repaired, left_out) if isinstance(repaired, CheckedPlan) else None


def _beside(plan: Plan, other: Plan) -> Plan:
    return replace(
        plan,
        tasks=(*plan.tasks, *other.tasks),
        pins={**plan.pins, **other.pins},
        conditions=tuple(dict.fromkeys([*plan.conditions, *other.conditions])),
        seeks=tuple(dict.fromkeys([*plan.seeks, *other.seeks])),
    )


def _for_goals(plan: Plan, goals: Iterable[Goal]) -> Plan:
    """The plan, answering for these goals, and for the places that it searches."""
    wanted = tuple(goals)
    conditions = [
        condition
        for goal in wanted
        for condition in goal.conditions
        if not set(plan.seeks) & set(condition.subjects)
    ]
    conditions += [c for c in plan.conditions if plan.seeks and c.relation == SEARCHED]
    return replace(
        plan,
        goals=tuple(goal.goal for goal in wanted),
        conditions=tuple(dict.fromkeys(conditions)),
    )


def _broken_goals(invalid: InvalidPlan, goals: Iterable[Goal]) -> frozenset[str]:
    """The goals that the checker's violations are about; none if one is about no goal."""
    plan = invalid.plan
    goal_of = {task.task: task.goal for task in plan.tasks}
    wants: dict[Condition, list[str]] = {}
    for goal in goals:
        for condition in goal.conditions:
            wants.setdefault(condition, []).append(goal.goal)
    if invalid.graph is None:
        return frozenset()
    broken: set[str] = set()
    for violation in invalid.violations:
        if violation.task is not None:
            served = goal_of[violation.task]
            about = [served] if served is not None else []
        elif violation.condition is not None:
            about = wants.get(violation.condition, [])
        elif violation.code == "no-robot":
            continue
        else:
            about = []
        if not about:
            return frozenset()
        broken.update(about)
    for actor, robots in invalid.able.items():
        if not robots:
            broken.update(t.goal for t in plan.tasks if t.actor == actor and t.goal is not None)
    return frozenset(broken)
