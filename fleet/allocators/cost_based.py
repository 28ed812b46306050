"""Rounds of linear assignment that keep travel short, as the reference's cost-based allocator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fleet.allocators.balanced import load_problem
from fleet.allocators.base import AllocationProblem, Allocator, Assignment, NotAllocated
from fleet.allocators.load_balancing import Unbalanced, balance
from fleet.allocators.reasons import not_apart
from keyexpr_schema.facts import AT, Value
from keyexpr_schema.ids import actor_arg

NEVER_S = 1e9
"""Cost of a robot that cannot be the actor, s: more than any travel, and safe to add up."""


@dataclass(frozen=True)
class _Trip:
    """Where an actor's first way leads, and where its robot stands in the end; `None` if unsaid."""

    to: str | None
    ends: Value


class CostBasedAllocator(Allocator):
    """The least cost of switching from one job to the next, round by round.

    In a round, every robot takes at most one of the actors that are ready: those whose first task
    waits for nothing but actors bound in earlier rounds. The sum of travel times from where the
    robots are by then is minimised (linear assignment: Jonker and Volgenant 1987, in the variant
    of Crouse 2016 that scipy has). It looks at no load: a robot that is near all the time does
    more than its share. Where actors that must be apart leave no robot, loads decide instead, and a
    note says so.
    """

    name = "cost-based"

    def _assign(self, problem: AllocationProblem) -> dict[str, str] | Assignment | NotAllocated:
        trips = _trips(problem)
        waits = _waits(problem)
        near: dict[str, set[str]] = {actor: set() for actor in problem.able}
        for one, other in problem.apart:
            near[one].add(other)
            near[other].add(one)
        where = {robot: problem.world.value(AT, robot) for robot in problem.world.team}
        chosen: dict[str, str] = {}
        while left := [actor for actor in problem.able if actor not in chosen]:
            ready = [actor for actor in left if waits[actor] <= chosen.keys()] or left
            costs = [_costs(problem, actor, trips, where, near, chosen) for actor in ready]
            bound = _round(ready, problem.world.team, costs)
            if not bound:
                return _otherwise(problem, ready[0])
            for actor, robot in bound.items():
                chosen[actor] = robot
                if trips[actor].ends is not None:
                    where[robot] = trips[actor].ends
        return chosen


def _round(
    ready: Sequence[str], team: Sequence[str], costs: Sequence[Sequence[float]]
) -> dict[str, str]:
    """The cheapest choice of a different robot for as many of the actors as can have one."""
    from scipy.optimize import linear_sum_assignment

    rows, columns = linear_sum_assignment(costs)
    return {
        ready[i]: team[j]
        for i, j in zip(rows.tolist(), columns.tolist(), strict=True)
        if costs[i][j] < NEVER_S
    }


def _costs(
    problem: AllocationProblem,
    actor: str,
    trips: Mapping[str, _Trip],
    where: Mapping[str, Value],
    near: Mapping[str, set[str]],
    chosen: Mapping[str, str],
) -> list[float]:
    """For every robot of the team: its way to where the actor starts, s."""
    taken = {chosen.get(other) for other in near[actor]}
    able = set(problem.able[actor]) - taken
    to = trips[actor].to
    return [
        NEVER_S
        if robot not in able
        else 0.0
        if to is None
        else problem.world.travel_s(robot, where[robot], to)
        for robot in problem.world.team
    ]


def _trips(problem: AllocationProblem) -> dict[str, _Trip]:
    to: dict[str, str] = {}
    ends: dict[str, Value] = {}
    graph = problem.checked.graph
    assert graph is not None  # the plan is valid
    actor_of = {task.task: task.actor for task in problem.plan.tasks}
    for task in graph.order:
        action, actor = problem.checked.actions[task], actor_of[task]
        if action.skill.travel_to is not None:
            to.setdefault(actor, action.args[action.skill.travel_to])
        for literal in action.after:
            if literal.variable == (AT, actor_arg(actor)):
                ends[actor] = literal.value
    return {actor: _Trip(to.get(actor), ends.get(actor)) for actor in problem.able}


def _waits(problem: AllocationProblem) -> dict[str, set[str]]:
    """For every actor the others whose tasks its first one follows."""
    graph = problem.checked.graph
    assert graph is not None  # the plan is valid
    tasks = {task.task: task for task in problem.plan.tasks}
    waits: dict[str, set[str]] = {}
    for name in graph.order:
        task = tasks[name]
        if task.actor not in waits:
            waits[task.actor] = {tasks[before].actor for before in task.after} - {task.actor}
    return waits


def _otherwise(problem: AllocationProblem, actor: str) -> Assignment | NotAllocated:
    """By load, where the rounds have left an actor without a robot; or why there is no way."""
    made = balance(load_problem(problem))
    actors = tuple(problem.able)
    if isinstance(made, Unbalanced):
        return not_apart(problem, [actors[a] for a in made.actors], made.proven)
    note = (
        "allocated by load and not by travel: after some rounds, every robot that can be actor "
        f"{actor} was one that it must be apart from"
    )
    team = problem.world.team
    chosen = {name: team[robot] for name, robot in zip(actors, made.robot, strict=True)}
    return Assignment(chosen, notes=(note,))
