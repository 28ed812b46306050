"""Where actors start to work, and how long their robots take to get there."""

from __future__ import annotations

from fleet.allocators.base import AllocationProblem
from keyexpr_schema.facts import AT


def first_destinations(problem: AllocationProblem) -> dict[str, str]:
    """By actor, where its first way leads; an actor that drives nowhere has none."""
    found: dict[str, str] = {}
    actor_of = {task.task: task.actor for task in problem.plan.tasks}
    graph = problem.checked.graph
    for task in graph.order if graph is not None else ():
        action = problem.checked.actions[task]
        if action.skill.travel_to is not None:
            found.setdefault(actor_of[task], action.args[action.skill.travel_to])
    return found


def approach_s(problem: AllocationProblem) -> dict[tuple[str, str], float]:
    """By actor and able robot: its way from where it is to where the actor starts to work, s."""
    world, to = problem.world, first_destinations(problem)
    where = {robot: world.value(AT, robot) for robot in world.team} if to else {}
    return {
        (actor, robot): world.travel_s(robot, where[robot], to[actor]) if actor in to else 0.0
        for actor, robots in problem.able.items()
        for robot in robots
    }
