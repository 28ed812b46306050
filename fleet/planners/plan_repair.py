"""Plan repair: a running plan goes on with its residual plan, as far as that still works.

Planning a thousand tasks again takes long, and would turn over what is well under way. So the
residual plan is checked as it stands; goals that it no longer serves (a cup is elsewhere, a lost
robot had it in its hand, the goal is new) are planned anew, alone, and put beside the rest. The
checker decides whether that is a plan.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from dataclasses import replace as changed

from msgspec.structs import replace

from fleet.core.actors import carried_at_end
from fleet.core.checker.plan_checker import CheckedPlan, InvalidPlan, check_plan
from fleet.planners.base import NoPlan, Planner, PlanningProblem
from fleet.planners.oversubscription import PartialPlan, plan_reachable_goals
from keyexpr_schema.facts import SEARCHED
from keyexpr_schema.payloads.goals import Condition, Goal
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
    whole = _for_goals(residual, problem.goals)
    checked = check_plan(whole, problem.world)
    if isinstance(checked, CheckedPlan):
        return PartialPlan(checked, changed=False)
    broken = _broken_goals(checked, problem.goals)
    rest = tuple(goal for goal in problem.goals if goal.goal not in broken)
    if not broken or all(goal.goal in reached for goal in rest):
        return None
    numbers = [int(task.task.removeprefix("t")) for task in residual.tasks]
    first = max([problem.first_task, *(number + 1 for number in numbers)])
    anew = tuple(goal for goal in problem.goals if goal.goal in broken)
    repaired = _without_tasks_of(residual, broken)
    beside = changed(problem, goals=anew, first_task=first, loads=_loads(checked, repaired.actors))
    part = plan_reachable_goals(planner, feasibility, beside)
    left_out: Mapping[str, str] = {}
    postponed: Mapping[str, str] = {}
    not_in_time: tuple[str, ...] = ()
    if not isinstance(part, NoPlan):
        left_out, postponed = part.left_out, part.postponed
        not_in_time = part.not_in_time
        repaired = _beside(repaired, part.plan)
    elif part.postponed:
        postponed = {goal.goal: part.reason for goal in anew}
        not_in_time = tuple(postponed)
    else:
        left_out = {goal.goal: part.reason for goal in anew}
    missing = left_out.keys() | postponed.keys()
    repaired = _for_goals(repaired, [g for g in problem.goals if g.goal not in missing])
    rechecked = check_plan(repaired, problem.world)
    if isinstance(rechecked, CheckedPlan):
        return PartialPlan(rechecked, left_out, postponed, not_in_time)
    return None


def _loads(residual: InvalidPlan, actors: Iterable[str]) -> tuple[frozenset[str], ...]:
    """For each of the actors that has a load in the end, the robots that can be it."""
    loaded = set(carried_at_end(residual).values()).intersection(actors)
    return tuple(frozenset(residual.able.get(actor, ())) for actor in sorted(loaded))


def _without_tasks_of(plan: Plan, goals: Set[str]) -> Plan:
    """The plan without the tasks of these goals, and without what only those tasks need."""
    tasks = tuple(task for task in plan.tasks if task.goal not in goals)
    kept = {task.task for task in tasks}
    actors = {task.actor for task in tasks}
    return replace(
        plan,
        tasks=tuple(replace(t, after=tuple(b for b in t.after if b in kept)) for t in tasks),
        pins={actor: robot for actor, robot in plan.pins.items() if actor in actors},
    )


def _beside(plan: Plan, other: Plan) -> Plan:
    """Both plans as one, with no order between them; their tasks' and actors' names differ."""
    return replace(
        plan,
        tasks=(*plan.tasks, *other.tasks),
        pins={**plan.pins, **other.pins},
        conditions=tuple(dict.fromkeys([*plan.conditions, *other.conditions])),
        seeks=tuple(dict.fromkeys([*plan.seeks, *other.seeks])),
        always=tuple(dict.fromkeys([*plan.always, *other.always])),
        never=tuple(dict.fromkeys([*plan.never, *other.never])),
        by={**plan.by, **other.by},
        sometime_before=tuple(dict.fromkeys([*plan.sometime_before, *other.sometime_before])),
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
        always=tuple(dict.fromkeys(row for goal in wanted for row in goal.always)),
        never=tuple(dict.fromkeys(row for goal in wanted for row in goal.never)),
        sometime_before=tuple(
            dict.fromkeys(row for goal in wanted for row in goal.sometime_before)
        ),
        by={goal.goal: goal.by for goal in wanted if goal.by},
    )


def _broken_goals(invalid: InvalidPlan, goals: Iterable[Goal]) -> frozenset[str]:
    """The goals that the checker's violations are about; none if one is about no goal."""
    plan = invalid.plan
    goal_of = {task.task: task.goal for task in plan.tasks}
    wants: dict[Condition, list[str]] = {}
    for goal in goals:
        for condition in (
            *goal.conditions,
            *goal.always,
            *goal.never,
            *(row.then for row in goal.sometime_before),
        ):
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
