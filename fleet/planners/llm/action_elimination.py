"""Action elimination: tasks that no goal needs are taken out of a valid plan.

After H. Nakhost and M. Müller, "Action Elimination and Plan Neighborhood Graph Search", ICAPS 2010.
"""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from fleet.core.checker.plan_checker import check_plan
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import AT, FactKey
from keyexpr_schema.payloads.plans import Plan, Task


def without_redundant_tasks(plan: Plan, world: WorldModel) -> Plan:
    """A valid plan less the tasks that no goal needs, however they got into it.

    A task is redundant if the plan is valid without it and all its successors, or without it alone.
    """
    # Where robots stand may change before the plan starts: the way to the work is not redundant.
    mentioned = {subject for condition in plan.conditions for subject in condition.subjects}
    unlocated = world.with_facts(
        {FactKey(AT, robot): None for robot in world.robots if robot not in mentioned}
    )
    if check_plan(plan, unlocated).violations:
        unlocated = world
    for with_successors in (True, False):
        plan = _eliminated(plan, unlocated, with_successors)
    return plan


def _eliminated(plan: Plan, world: WorldModel, with_successors: bool) -> Plan:
    graph = TaskGraph({task.task: task.after for task in plan.tasks})
    for task in graph.order:
        if all(task != row.task for row in plan.tasks):
            continue
        after = [t for t in graph.order if graph.precedes(task, t)] if with_successors else []
        reduced = _without(plan, frozenset({task, *after}))
        if not check_plan(reduced, world).violations:
            plan = reduced
            graph = TaskGraph({row.task: row.after for row in plan.tasks})
    return plan


def _without(plan: Plan, removed: frozenset[str]) -> Plan:
    """The plan without some tasks; what waited for one of them waits for what that waited for."""
    by_name = {task.task: task for task in plan.tasks}

    def kept_predecessors(befores: Iterable[str]) -> tuple[str, ...]:
        found: dict[str, None] = {}
        stack = list(befores)
        seen: set[str] = set()
        while stack:
            before = stack.pop()
            if before in seen:
                continue
            seen.add(before)
            if before in removed:
                stack.extend(by_name[before].after)
            else:
                found[before] = None
        return tuple(found)

    tasks: tuple[Task, ...] = tuple(
        replace(task, after=kept_predecessors(task.after))
        for task in plan.tasks
        if task.task not in removed
    )
    actors = {task.actor for task in tasks}
    pins = {actor: robot for actor, robot in plan.pins.items() if actor in actors}
    return replace(plan, tasks=tasks, pins=pins)
