"""A plan and a fleet as a shop: tasks are operations, actors blocks, robots machines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

from fleet.core.actors import carried_at_end, first_actors
from fleet.core.checker.plan_checker import CheckedPlan
from fleet.core.model.durations import only_moves
from fleet.core.model.skills import Action
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel
from fleet.jobshop.problem import Block, Machine, Operation, Position, Shop
from fleet.scheduling.allocation_context import AllocationContext
from keyexpr_schema.facts import AT, FactKey, Value
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.plans import Plan

MOST_PRIORITY = 8
"""Priorities beyond this count as this: weights double with each step."""
ANYWHERE = 0
"""The site that stands for wherever a robot may be."""
ANY = Position.ANYWHERE


@dataclass(frozen=True)
class PlanShop:
    """The shop, with the names of its blocks, machines and operations."""

    shop: Shop
    actors: tuple[str, ...]
    """Of each block; robots that the plan names itself have a block of their own behind these."""
    robots: tuple[str, ...]
    tasks: tuple[str, ...]

    def relaxed(self) -> Iterator[Shop]:
        """The shop; behind it, if it is another one, that in which robots that the plan names take
        part in any number of tasks at once, and any actor may come first or last: what must be
        first or last, or is named, may leave no order that the checker passes.
        """
        count, shop = len(self.actors), self.shop
        yield shop
        if len(shop.blocks) == count and all(b.position == ANY for b in shop.blocks):
            return
        blocks = tuple(replace(block, position=ANY) for block in shop.blocks[:count])
        operations = tuple(
            replace(operation, blocks=tuple(b for b in operation.blocks if b < count))
            for operation in shop.operations
        )
        yield replace(shop, blocks=blocks, operations=operations)


def plan_shop(
    checked: CheckedPlan,
    able: Mapping[str, Sequence[str]],
    apart: frozenset[tuple[str, str]] = frozenset(),
    context: AllocationContext | None = None,
) -> PlanShop:
    """The plan in numbers. Durations are the skill models', at each kind of robot's speed.

    `able` has the robots that each actor may be, `apart` the pairs that must be different ones.

    Raises:
        BadShop: some actor has no robot that can be it.
    """
    context = context or AllocationContext()
    world, graph = checked.world, checked.graph
    robots = tuple(world.team)
    machine = {robot: i for i, robot in enumerate(robots)}
    block_of = {actor_arg(actor): i for i, actor in enumerate(able)}
    """With robots that the plan names, if they are connected: others are no machines."""
    number = {task: i for i, task in enumerate(graph.order)}
    numbers = _Numbers(world, robots)
    weights, dues_s = _weights_and_dues(checked.plan, graph, context)
    operations: list[Operation] = []
    members: list[list[int]] = [[] for _ in able]
    for i, task in enumerate(graph.order):
        action = checked.actions[task]
        blocks: dict[int, None] = {}
        for participant in action.participants:
            if participant in machine and participant not in block_of:
                block_of[participant] = len(members)
                members.append([])
            if participant in block_of:
                blocks[block_of[participant]] = None
        for block in blocks:
            members[block].append(i)
        target, arrives = numbers.sites(action)
        operations.append(
            Operation(
                blocks=tuple(blocks),
                duration_s=numbers.durations_s(action),
                after=tuple(sorted(number[before] for before in graph.predecessors[task])),
                target=target,
                arrives=arrives,
                weight=weights.get(task, 0.0),
                due_s=dues_s.get(task, inf),
            )
        )
    able_of = {actor_arg(actor): rows for actor, rows in able.items()}
    positions = _positions(checked, able, context)
    kept_apart: dict[str, set[int]] = {}
    for pair in apart:
        one, other = map(actor_arg, pair)
        if one in block_of and other in block_of:
            kept_apart.setdefault(one, set()).add(block_of[other])
            kept_apart.setdefault(other, set()).add(block_of[one])
    blocks_ = tuple(
        Block(
            operations=tuple(members[block]),
            machines=tuple(machine[robot] for robot in able_of.get(name, (name,))),
            position=positions.get(name, ANY),
            apart=frozenset(kept_apart.get(name, ())),
        )
        for name, block in block_of.items()
    )
    machines = tuple(
        Machine(numbers.kind_of[r], numbers.site(world.value(AT, r)), context.ready_s.get(r, 0.0))
        for r in robots
    )
    shop = Shop(tuple(operations), blocks_, machines, numbers.travel_s())
    return PlanShop(shop, tuple(able), robots, graph.order)


class _Way(NamedTuple):
    """The way to a place by a skill that only gets a robot there: nothing to do if it is there."""

    place: str
    skill: str


class _Numbers:
    """Kinds of robots, sites, and how long things take."""

    def __init__(self, world: WorldModel, robots: tuple[str, ...]) -> None:
        self._world = world
        kinds: dict[tuple[object, ...], int] = {}
        self.kind_of = {}
        self._samples: list[str] = []
        for robot in robots:
            # What a robot's durations depend on; the first of a kind stands for all.
            spec = world.robots[robot]
            what = (spec.model, world.capability(robot, "drive"), spec.battery)
            if what not in kinds:
                kinds[what] = len(kinds)
                self._samples.append(robot)
            self.kind_of[robot] = kinds[what]
        self._sites: dict[Value | _Way, int] = {None: ANYWHERE}
        """Those that the plan or a robot is at; `travel_s` is for these."""
        self._durations_s: dict[str, tuple[float, ...]] = {}

    def site(self, place: Value) -> int:
        """Its number."""
        if place not in self._world.places:
            return ANYWHERE
        return self._sites.setdefault(place, len(self._sites))

    def sites(self, action: Action) -> tuple[int | None, int | None]:
        """Where the action's robot drives first, and where it is afterwards, if that is said."""
        travel_to = action.skill.travel_to
        target = ANYWHERE if travel_to is None else self.site(action.args[travel_to])
        if target and travel_to is not None and only_moves(action.skill):
            way = _Way(action.args[travel_to], action.skill.name)
            target = self._sites.setdefault(way, len(self._sites))
        place = FactKey(AT, action.actor)
        moved = [value for variable, value in action.after if variable == place]
        return target or None, self.site(moved[-1]) if moved else None

    def durations_s(self, action: Action) -> tuple[float, ...]:
        """By kind of robot, without the travel: nothing for those that only travel; at a charger
        with the time for which it is taken."""
        skill = action.skill
        if only_moves(skill):
            return (0.0,) * len(self._samples)
        if skill.recharges:
            here, duration_s = action.place, self._world.duration_s
            return tuple(duration_s(action, here, robot) for robot in self._samples)
        if skill.name not in self._durations_s:
            self._durations_s[skill.name] = tuple(
                self._world.work_s(robot, skill) for robot in self._samples
            )
        return self._durations_s[skill.name]

    def travel_s(self) -> tuple[tuple[tuple[float, ...], ...], ...]:
        """By kind, origin and target."""
        return tuple(self._travel_of(robot) for robot in self._samples)

    def _travel_of(self, robot: str) -> tuple[tuple[float, ...], ...]:
        rows: dict[Value, tuple[float, ...]] = {}
        for site in self._sites:
            place = site.place if isinstance(site, _Way) else site
            if place not in rows:
                rows[place] = tuple(self._way_s(robot, place, target) for target in self._sites)
        return tuple(rows[s.place if isinstance(s, _Way) else s] for s in self._sites)

    def _way_s(self, robot: str, origin: Value, target: Value | _Way) -> float:
        if isinstance(target, _Way):
            if origin == target.place:
                return 0.0
            work_s = self._world.work_s(robot, self._world.skills[target.skill])
            return work_s + self._world.travel_s(robot, origin, target.place)
        return self._world.travel_s(robot, origin, target) if isinstance(target, str) else 0.0


def _positions(
    checked: CheckedPlan, actors: Mapping[str, object], context: AllocationContext
) -> dict[str, Position]:
    """Actors that have a load at the end come last; those that are under way, or need their robot
    as it is now and as others would not leave it, come first."""
    last = set(carried_at_end(checked).values())
    first = first_actors(checked)
    positions: dict[str, Position] = {}
    for actor in actors:
        if actor in first:
            positions[actor_arg(actor)] = Position.FIRST
        elif actor in last:
            positions[actor_arg(actor)] = Position.LAST
        elif actor in context.under_way:
            positions[actor_arg(actor)] = Position.FIRST
    return positions


def _weights_and_dues(
    plan: Plan, graph: TaskGraph, context: AllocationContext
) -> tuple[dict[str, float], dict[str, float]]:
    """Weight and due time of the tasks with which goals end, s from now."""
    goal_of = {task.task: task.goal for task in plan.tasks}
    weights: dict[str, float] = {}
    dues_s: dict[str, float] = {}
    for task, goal in goal_of.items():
        if any(goal_of[later] == goal for later in graph.successors[task]):
            continue
        priority = context.priority.get(goal, 0) if goal else 0
        weights[task] = 2.0 ** max(-MOST_PRIORITY, min(priority, MOST_PRIORITY))
        if goal is not None and goal in context.due_s:
            dues_s[task] = context.due_s[goal]
    return weights, dues_s
