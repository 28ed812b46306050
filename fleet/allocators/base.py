"""The allocator interface: actors in, robots out, with their check."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field

import msgspec

from fleet.core.actors import actors_apart, task_counts
from fleet.core.checker.plan_checker import CheckedPlan, check_plan
from fleet.core.model.world import WorldModel
from fleet.scheduling.allocation_context import AllocationContext
from fleet.scheduling.plan_schedule import AllocatedPlan, PlanSchedule
from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.plans import Plan, Violation

SEARCH_SHARE = 0.25
"""Of what is left until there has to be a plan, how much a search takes at most: checking takes
some as well, and perhaps it is allocated once more."""


@dataclass(frozen=True)
class Allocated:
    """A plan with a robot for every actor and an order of actors for every robot.

    `lower_bound_s` is proven, where the allocator gives one: no allocation has a shorter schedule.
    `notes` say how the answer was found, for people.
    """

    allocation: Mapping[str, str]
    schedule: PlanSchedule
    lower_bound_s: float | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Assignment:
    """What an allocator chose: a robot for every actor, and perhaps in which order they come.

    `actor_order` lists all actors; every robot takes its own in that order. Without it the base
    class looks for a good one.
    """

    allocation: Mapping[str, str]
    actor_order: tuple[str, ...] | None = None
    lower_bound_s: float | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class NotAllocated:
    """Why there is no allocation; never empty."""

    violations: tuple[Violation, ...]


@dataclass(frozen=True)
class AllocationProblem:
    """What an allocator chooses from.

    `able` lists the robots that can be each actor. `load` counts each actor's tasks. `apart` holds
    pairs of actors that must be different robots.
    """

    checked: CheckedPlan
    able: Mapping[str, tuple[str, ...]]
    load: Mapping[str, int]
    apart: frozenset[tuple[str, str]]
    context: AllocationContext = field(default_factory=AllocationContext)

    @property
    def plan(self) -> Plan:
        """The plan to be allocated."""
        return self.checked.plan

    @property
    def world(self) -> WorldModel:
        """The world that the plan is valid in."""
        return self.checked.world

    def search_s(self, wanted_s: float) -> float:
        """Seconds that a search which would like `wanted_s` may take now."""
        return min(wanted_s, SEARCH_SHARE * self.context.limit.left_s)

    def first_destinations(self) -> dict[str, str]:
        """By actor, where its first way leads; an actor that drives nowhere has none."""
        destinations: dict[str, str] = {}
        actor_of = {task.task: task.actor for task in self.plan.tasks}
        for task in self.checked.graph.order:
            action = self.checked.actions[task]
            if action.skill.travel_to is not None:
                destinations.setdefault(actor_of[task], action.args[action.skill.travel_to])
        return destinations

    def approach_s(self) -> dict[tuple[str, str], float]:
        """By actor and able robot: its way from where it is to where the actor begins, s."""
        world, to = self.world, self.first_destinations()
        where = {robot: world.value(AT, robot) for robot in world.team}
        return {
            (actor, robot): world.travel_s(robot, where[robot], to[actor]) if actor in to else 0.0
            for actor, robots in self.able.items()
            for robot in robots
        }


class Allocator(ABC):
    """Binds actors to robots. Subclasses choose; this class checks what comes out."""

    name: str
    reschedules = False
    """Whether it heeds the `previous_allocation` itself; for others, actors stay where they can."""
    waiting_s: float = 0.0
    """How long it may wait for others, such as a language model, beside the limit for planning."""

    def allocate(
        self, checked: CheckedPlan, context: AllocationContext | None = None
    ) -> Allocated | NotAllocated:
        """A checked allocation of a plan to the connected robots of its world, or why none.

        Tasks of one actor go to one robot, in order; a robot does its actors one after the other.
        """
        context = context or AllocationContext()
        if context.previous_allocation and not self.reschedules:
            plan, world = checked.plan, checked.world
            previous = context.previous_allocation
            stay = {a: robot for a, robot in previous.items() if robot in world.team}
            pins = {a: robot for a, robot in {**stay, **plan.pins}.items() if a in plan.actors}
            if pins != plan.pins:
                pinned = check_plan(msgspec.structs.replace(plan, pins=pins), world)
                if isinstance(pinned, CheckedPlan):
                    found = self._allocate(pinned, context)
                    if isinstance(found, Allocated):
                        return found
        return self._allocate(checked, context)

    def _allocate(
        self, checked: CheckedPlan, context: AllocationContext
    ) -> Allocated | NotAllocated:
        problem = AllocationProblem(
            checked=checked,
            able=checked.able,
            load=task_counts(checked.plan),
            apart=actors_apart(checked),
            context=context,
        )
        chosen = self._assign(problem)
        if isinstance(chosen, NotAllocated):
            return chosen
        for actor, able in problem.able.items():
            if (robot := chosen.allocation.get(actor)) not in able:
                sentence = (
                    f"allocator {self.name} makes {robot} actor {actor}, not {' or '.join(able)}"
                )
                return NotAllocated((Violation(code="no-allocation", sentence=sentence),))
        return _scheduled(problem, chosen)

    @abstractmethod
    def _assign(self, problem: AllocationProblem) -> Assignment | NotAllocated:
        """A robot for every actor, among those able; or why there is none."""


def _scheduled(problem: AllocationProblem, chosen: Assignment) -> Allocated | NotAllocated:
    """In the order that was chosen with the robots, if that will do, or else in another one."""
    allocation = chosen.allocation
    plan = AllocatedPlan(problem.checked, allocation, problem.context)
    found = plan.schedule(chosen.actor_order) if chosen.actor_order is not None else None
    if found is None or plan.violations(found):
        other = plan.valid_schedule(thorough=True)
        if isinstance(other, tuple):
            return NotAllocated(other)
        found = other
    return Allocated(allocation, found, chosen.lower_bound_s, chosen.notes)
