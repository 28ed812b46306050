"""A plan and a fleet as a shop: tasks are operations, actors blocks, robots machines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf

from fleet.allocators.base import AllocationProblem
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from fleet.core.schedule.actor_order import carried_at_end, first_actors
from fleet.core.schedule.plan_schedule import predicted_duration_s
from fleet.jobshop.problem import Block, Machine, Operation, Position, Shop
from keyexpr_schema.facts import AT, FactKey, Value
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.plans import Plan

MOST_PRIORITY = 8
"""Priorities beyond this count as this: weights double with each step."""


@dataclass(frozen=True)
class PlanShop:
    """The shop, with the names of its blocks, machines and operations."""

    shop: Shop
    actors: tuple[str, ...]
    """Of each block; robots that the plan names itself have a block of their own behind these."""
    robots: tuple[str, ...]
    tasks: tuple[str, ...]


def plan_shop(problem: AllocationProblem) -> PlanShop:
    """The problem in numbers. Durations are the skill models', at each kind of robot's speed.

    Raises:
        BadShop: some actor has no robot that can be it.
    """
    world, graph = problem.world, problem.checked.graph
    assert graph is not None, "a valid plan has a graph"
    robots = tuple(world.team)
    actors = tuple(problem.able)
    names = {actor_arg(actor): i for i, actor in enumerate(actors)}
    number = {task: i for i, task in enumerate(graph.order)}
    numbers = _Numbers(world, robots)
    weights, dues = _wishes(problem)
    operations: list[Operation] = []
    of_block: dict[int, list[int]] = {i: [] for i in range(len(actors))}
    for i, task in enumerate(graph.order):
        action = problem.checked.actions[task]
        for participant in action.participants:
            names.setdefault(participant, len(names))
        blocks = tuple(dict.fromkeys(names[name] for name in action.participants))
        for block in blocks:
            of_block.setdefault(block, []).append(i)
        target, arrives = numbers.travel(action)
        operations.append(
            Operation(
                blocks=blocks,
                duration_s=numbers.durations(action),
                after=tuple(sorted(number[before] for before in graph.predecessors[task])),
                target=target,
                arrives=arrives,
                weight=weights.get(task, 0.0),
                due_s=dues.get(task, inf),
            )
        )
    machine = {robot: i for i, robot in enumerate(robots)}
    able = {actor_arg(actor): rows for actor, rows in problem.able.items()}
    positions = _positions(problem, actors)
    apart = _apart(problem, {actor: i for i, actor in enumerate(actors)})
    blocks_of = tuple(
        Block(
            operations=tuple(of_block[block]),
            machines=tuple(machine[robot] for robot in able.get(name, (name,))),
            position=positions.get(name, Position.ANYWHERE),
            apart=apart.get(block, frozenset()),
        )
        for name, block in names.items()
    )
    ready_s = problem.circumstances.ready_s
    machines = tuple(
        Machine(numbers.kind_of[r], numbers.site(world.value(AT, r)), ready_s.get(r, 0.0))
        for r in robots
    )
    shop = Shop(tuple(operations), blocks_of, machines, numbers.travel_s())
    return PlanShop(shop, actors, robots, graph.order)


class _Numbers:
    """Kinds of robots, sites, and how long things take."""

    def __init__(self, world: WorldModel, robots: tuple[str, ...]) -> None:
        self._world = world
        kinds: dict[tuple[str, float | None], int] = {}
        self.kind_of = {}
        self._samples: list[str] = []
        for robot in robots:
            # What a robot's durations depend on; the first of a kind stands for all.
            what = (world.robots[robot].model, world.capability(robot, "drive"))
            if what not in kinds:
                kinds[what] = len(kinds)
                self._samples.append(robot)
            self.kind_of[robot] = kinds[what]
        self._sites: dict[Value, int] = {place: i for i, place in enumerate(world.places)}
        self._anywhere = len(self._sites)
        self._durations: dict[str, tuple[float, ...]] = {}

    def site(self, place: Value) -> int:
        """Its number; one beyond the places stands for wherever the robot may be."""
        return self._sites.get(place, self._anywhere)

    def travel(self, action: Action) -> tuple[int | None, int | None]:
        """Where the action's robot drives first, and where it is afterwards, if that is said."""
        travel_to = action.skill.travel_to
        target = None if travel_to is None else self._sites.get(action.args[travel_to])
        place = FactKey(AT, action.actor)
        moved = [value for variable, value in action.after if variable == place]
        return target, self.site(moved[-1]) if moved else None

    def durations(self, action: Action) -> tuple[float, ...]:
        """By kind of robot, without the travel, s."""
        skill = action.skill
        if skill.name not in self._durations:
            here = None if skill.travel_to is None else action.args[skill.travel_to]
            self._durations[skill.name] = tuple(
                predicted_duration_s(action, here, robot, self._world) for robot in self._samples
            )
        return self._durations[skill.name]

    def travel_s(self) -> tuple[tuple[tuple[float, ...], ...], ...]:
        """By kind, origin and target, s."""
        places = tuple(self._world.places)
        return tuple(
            tuple(
                tuple(self._world.travel_s(robot, origin, target) for target in places)
                for origin in (*places, None)
            )
            for robot in self._samples
        )


def _apart(problem: AllocationProblem, block_of: Mapping[str, int]) -> dict[int, frozenset[int]]:
    found: dict[int, set[int]] = {}
    for one, other in problem.apart:
        if one in block_of and other in block_of:
            found.setdefault(block_of[one], set()).add(block_of[other])
            found.setdefault(block_of[other], set()).add(block_of[one])
    return {block: frozenset(others) for block, others in found.items()}


def _positions(problem: AllocationProblem, actors: tuple[str, ...]) -> dict[str, Position]:
    """Actors that have a load at the end come last; those that are under way, or need their robot
    as it is now and as others would not leave it, come first."""
    last = set(carried_at_end(problem.checked).values())
    first = first_actors(problem.checked)
    positions: dict[str, Position] = {}
    for actor in actors:
        if actor in first:
            positions[actor_arg(actor)] = Position.FIRST
        elif actor in last:
            positions[actor_arg(actor)] = Position.LAST
        elif actor in problem.circumstances.under_way:
            positions[actor_arg(actor)] = Position.FIRST
    return positions


def _wishes(problem: AllocationProblem) -> tuple[dict[str, float], dict[str, float]]:
    """Weight and due time of the tasks with which goals end, s from now."""
    plan: Plan = problem.plan
    graph = problem.checked.graph
    assert graph is not None
    goal_of = {task.task: task.goal for task in plan.tasks}
    weights: dict[str, float] = {}
    dues: dict[str, float] = {}
    told = problem.circumstances
    for task, goal in goal_of.items():
        if any(goal_of[later] == goal for later in graph.successors[task]):
            continue
        priority = told.priority.get(goal, 0) if goal else 0
        weights[task] = 2.0 ** max(-MOST_PRIORITY, min(priority, MOST_PRIORITY))
        if goal is not None and goal in told.due_s:
            dues[task] = told.due_s[goal]
    return weights, dues
