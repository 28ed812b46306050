"""Rounds of linear assignment that keep travel short, as the reference's cost-based allocator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.allocators.approach import first_destinations
from fleet.allocators.balancing_problem import balancing_problem
from fleet.allocators.base import AllocationProblem, Allocator, Assignment, NotAllocated
from fleet.allocators.min_max_load import assign_balanced
from keyexpr_schema.facts import AT, Value
from keyexpr_schema.ids import actor_arg

UNABLE_S = 1e9
"""Cost of a robot that cannot be the actor, s: more than any travel, and safe to add up."""


class CostBasedAllocator(Allocator):
    """The least cost of switching from one job to the next, round by round."""

    name = "cost-based"

    def _assign(self, problem: AllocationProblem) -> Assignment | NotAllocated:
        return assign_in_rounds(problem)


def assign_in_rounds(problem: AllocationProblem) -> Assignment | NotAllocated:
    """In a round, every robot takes at most one of the actors that are ready: those whose first
    task waits for nothing but actors bound in earlier rounds.

    The sum of travel times from where the robots are by then is minimised (linear assignment:
    Jonker and Volgenant 1987, in the variant of Crouse 2016 that scipy has). It looks at no load: a
    robot that is near all the time does more than its share. Where actors that must be apart leave
    no robot, loads decide instead, and a note says so.
    """
    world = problem.world
    conflicts = balancing_problem(problem).conflicts
    names = tuple(problem.able)
    conflicting = {names[a]: {names[other] for other in near} for a, near in enumerate(conflicts)}
    destination, last_place = first_destinations(problem), _last_places(problem)
    predecessors = _predecessors(problem)
    where = {robot: world.value(AT, robot) for robot in world.team}
    chosen: dict[str, str] = {}

    def costs(actor: str) -> list[float]:
        """For every robot of the team: its way to where the actor starts, s."""
        able = set(problem.able[actor]) - {chosen.get(other) for other in conflicting[actor]}
        to = destination.get(actor)
        return [
            UNABLE_S
            if robot not in able
            else 0.0
            if to is None
            else world.travel_s(robot, where[robot], to)
            for robot in world.team
        ]

    while left := [actor for actor in problem.able if actor not in chosen]:
        ready = [actor for actor in left if predecessors[actor] <= chosen.keys()] or left
        bound = _cheapest(ready, world.team, [costs(actor) for actor in ready])
        if not bound:
            return _balanced_instead(problem, ready[0])
        chosen.update(bound)
        where.update({bound[actor]: last_place[actor] for actor in bound.keys() & last_place})
    return Assignment(chosen)


def _cheapest(
    ready: Sequence[str], team: Sequence[str], costs: Sequence[Sequence[float]]
) -> dict[str, str]:
    """The cheapest choice of a different robot for as many of the actors as can have one."""
    from scipy.optimize import linear_sum_assignment

    rows, columns = linear_sum_assignment(costs)
    return {
        ready[i]: team[j]
        for i, j in zip(rows.tolist(), columns.tolist(), strict=True)
        if costs[i][j] < UNABLE_S
    }


def _last_places(problem: AllocationProblem) -> dict[str, Value]:
    """By actor, where its robot is in the end, if the plan says it."""
    graph = problem.checked.graph
    assert graph is not None  # the plan is valid
    places: dict[str, Value] = {}
    actor_of = {task.task: task.actor for task in problem.plan.tasks}
    for task in graph.order:
        for literal in problem.checked.actions[task].after:
            if literal.variable == (AT, actor_arg(actor_of[task])):
                places[actor_of[task]] = literal.value
    return places


def _predecessors(problem: AllocationProblem) -> dict[str, set[str]]:
    """For every actor the others whose tasks its first one follows."""
    graph = problem.checked.graph
    assert graph is not None  # the plan is valid
    tasks = {task.task: task for task in problem.plan.tasks}
    found: dict[str, set[str]] = {}
    for name in graph.order:
        task = tasks[name]
        if task.actor not in found:
            found[task.actor] = {tasks[before].actor for before in task.after} - {task.actor}
    return found


def _balanced_instead(problem: AllocationProblem, actor: str) -> Assignment | NotAllocated:
    """By load, where the rounds have left an actor without a robot; or why there is no way."""
    found = assign_balanced(problem)
    if isinstance(found, NotAllocated):
        return found
    note = (
        "allocated by load and not by travel: after some rounds, every robot that can be actor "
        f"{actor} was one that it must be apart from"
    )
    return replace(found, notes=(note, *found.notes))
