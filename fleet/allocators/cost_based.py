"""Rounds of linear assignment that keep travel short, as the reference's cost-based allocator."""

from __future__ import annotations

from dataclasses import replace

from fleet.allocators.balancing_problem import balancing_problem, named
from fleet.allocators.base import AllocationProblem, Allocator, Assignment, NotAllocated
from fleet.allocators.load_balancing.local_search import PartialAssignment
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
    from scipy.optimize import linear_sum_assignment

    world, names = problem.world, tuple(problem.able)
    partial = PartialAssignment(balancing_problem(problem))
    destination, last_place = problem.first_destinations(), _last_places(problem)
    predecessors = _predecessors(problem)
    bound: set[str] = set()
    where = [world.value(AT, robot) for robot in world.team]

    def costs(actor: int) -> list[float]:
        """For every robot of the team: its way to where the actor starts, s."""
        free, to = partial.free(actor), destination.get(names[actor])
        return [
            UNABLE_S
            if not free >> r & 1
            else 0.0
            if to is None
            else world.travel_s(robot, where[r], to)
            for r, robot in enumerate(world.team)
        ]

    while left := [actor for actor, robot in enumerate(partial.robot) if robot < 0]:
        ready = [actor for actor in left if predecessors[names[actor]] <= bound] or left
        way_s = [costs(actor) for actor in ready]
        rows, columns = linear_sum_assignment(way_s)
        pairs = list(zip(rows.tolist(), columns.tolist(), strict=True))
        if all(way_s[i][robot] >= UNABLE_S for i, robot in pairs):
            return _balanced_instead(problem, names[ready[0]])
        for i, robot in pairs:
            if way_s[i][robot] < UNABLE_S:
                actor = names[ready[i]]
                partial.assign(ready[i], robot)
                bound.add(actor)
                last = last_place.get(actor)
                where[robot] = where[robot] if last is None else last
    return Assignment(named(problem, partial.robot))


def _last_places(problem: AllocationProblem) -> dict[str, Value]:
    """By actor, where its robot is in the end, if the plan says it."""
    places: dict[str, Value] = {}
    actor_of = {task.task: task.actor for task in problem.plan.tasks}
    for task in problem.checked.graph.order:
        for literal in problem.checked.actions[task].after:
            if literal.variable == (AT, actor_arg(actor_of[task])):
                places[actor_of[task]] = literal.value
    return places


def _predecessors(problem: AllocationProblem) -> dict[str, set[str]]:
    """For every actor the others whose tasks its first one follows."""
    tasks = {task.task: task for task in problem.plan.tasks}
    predecessors: dict[str, set[str]] = {}
    for name in problem.checked.graph.order:
        actor, after = tasks[name].actor, tasks[name].after
        predecessors.setdefault(actor, {tasks[before].actor for before in after} - {actor})
    return predecessors


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
