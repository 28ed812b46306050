"""What a model's plan must stand up to: the checker, some able team, and use for a goal."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from msgspec.structs import replace

from fleet.core.checker.plan_checker import check_plan
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel
from fleet.core.schedule.actor_constraints import least_loaded
from fleet.core.schedule.plan_schedule import best_schedule
from keyexpr_schema.facts import AT, FactKey
from keyexpr_schema.payloads.plans import Plan, Task, Violation


def why_not(plan: Plan, world: WorldModel) -> tuple[Violation, ...]:
    """What speaks against a plan, once robots are to be found for it included."""
    if foreign := _foreign_goals(plan):
        return foreign
    checked = check_plan(plan, world)
    if not checked.valid or not plan.tasks:
        return checked.violations
    allocation = least_loaded(plan, checked, world)
    if allocation is None:
        return (
            Violation(
                code="too-few-robots",
                sentence="there are fewer able robots than the plan needs at the same time: "
                "let the same actor do more of it",
            ),
        )
    found = best_schedule(plan, checked, allocation, world)
    if found is None:
        return (
            Violation(
                code="deadlock",
                sentence="with the robots there are, some would wait for each other for ever: "
                "let actors that meet do less in between",
            ),
        )
    return check_plan(plan, world, allocation, found.extra_after).violations


def _foreign_goals(plan: Plan) -> tuple[Violation, ...]:
    return tuple(
        Violation(
            code="unknown-goal",
            sentence=f"{task.task} is for goal {task.goal}; "
            f"goals are {', '.join(plan.goals) or 'none'}",
            task=task.task,
        )
        for task in plan.tasks
        if task.goal not in plan.goals
    )


def without_useless(plan: Plan, world: WorldModel) -> Plan:
    """A valid plan less the tasks that no goal needs, however they got into it.

    A task is useless if the plan stands up to the checker without it and all that comes after it,
    or without it alone.
    """
    # Where robots stand may change before the plan starts: the way to the work is not useless.
    spoken_of = {subject for condition in plan.conditions for subject in condition.subjects}
    somewhere = world.with_facts(
        {FactKey(AT, robot): None for robot in world.robots if robot not in spoken_of}
    )
    if not check_plan(plan, somewhere).valid:
        somewhere = world
    for choice in (_with_followers, _alone):
        plan = _thinned(plan, somewhere, choice)
    return plan


def _thinned(
    plan: Plan, world: WorldModel, choice: Callable[[TaskGraph, str], frozenset[str]]
) -> Plan:
    graph = TaskGraph({task.task: task.after for task in plan.tasks})
    for task in graph.order:
        if all(task != row.task for row in plan.tasks):
            continue
        less = _less(plan, choice(graph, task))
        if check_plan(less, world).valid:
            plan = less
            graph = TaskGraph({row.task: row.after for row in plan.tasks})
    return plan


def _with_followers(graph: TaskGraph, task: str) -> frozenset[str]:
    return frozenset({task, *(other for other in graph.order if graph.precedes(task, other))})


def _alone(graph: TaskGraph, task: str) -> frozenset[str]:
    return frozenset({task})


def _less(plan: Plan, left_out: frozenset[str]) -> Plan:
    """The plan without some tasks; what waited for one of them waits for what that waited for."""
    by_name = {task.task: task for task in plan.tasks}

    def stand_ins(befores: Iterable[str]) -> tuple[str, ...]:
        found: dict[str, None] = {}
        stack = list(befores)
        seen: set[str] = set()
        while stack:
            before = stack.pop()
            if before in seen:
                continue
            seen.add(before)
            if before in left_out:
                stack.extend(by_name[before].after)
            else:
                found[before] = None
        return tuple(found)

    tasks: tuple[Task, ...] = tuple(
        replace(task, after=stand_ins(task.after))
        for task in plan.tasks
        if task.task not in left_out
    )
    actors = {task.actor for task in tasks}
    pins = {actor: robot for actor, robot in plan.pins.items() if actor in actors}
    return replace(plan, tasks=tasks, pins=pins)
