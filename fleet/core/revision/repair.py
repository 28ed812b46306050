"""The pure part of plan repair: which goals are broken, and what stands beside the rest."""

from __future__ import annotations

from collections.abc import Iterable, Set

from msgspec.structs import replace

from fleet.core.checker.checked_plan import InvalidPlan
from keyexpr_schema.facts import SEARCHED
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan


def without_tasks_of(plan: Plan, goals: Set[str]) -> Plan:
    """The plan without the tasks of these goals, and without what only those tasks need."""
    tasks = tuple(task for task in plan.tasks if task.goal not in goals)
    kept = {task.task for task in tasks}
    actors = {task.actor for task in tasks}
    return replace(
        plan,
        tasks=tuple(replace(t, after=tuple(b for b in t.after if b in kept)) for t in tasks),
        pins={actor: robot for actor, robot in plan.pins.items() if actor in actors},
    )


def beside(plan: Plan, other: Plan) -> Plan:
    """Both plans as one, with no order between them; their tasks' and actors' names differ."""
    return replace(
        plan,
        tasks=(*plan.tasks, *other.tasks),
        pins={**plan.pins, **other.pins},
        conditions=tuple(dict.fromkeys([*plan.conditions, *other.conditions])),
        seeks=tuple(dict.fromkeys([*plan.seeks, *other.seeks])),
    )


def for_goals(plan: Plan, goals: Iterable[Goal]) -> Plan:
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


def broken_goals(invalid: InvalidPlan, goals: Iterable[Goal]) -> frozenset[str]:
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
