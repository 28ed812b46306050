"""The allocator interface: actors in, robots out, checked on both sides."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import msgspec

from fleet.core.checker.plan_checker import CheckedPlan, check_plan
from fleet.core.model.world import WorldModel
from fleet.core.schedule.actor_constraints import (
    able_robots,
    actors_apart,
    task_counts,
    tasks_nobody_can_do,
)
from fleet.core.schedule.plan_schedule import Schedule, schedule, valid_schedule
from keyexpr_schema.payloads.plans import Plan, Violation


@dataclass(frozen=True)
class Allocated:
    """A plan with a robot for every actor and an order of actors for every robot.

    `lower_bound_s` is proven, where the allocator gives one: no allocation has a shorter schedule.
    `notes` say how the answer was found, for people.
    """

    allocation: Mapping[str, str]
    schedule: Schedule
    lower_bound_s: float | None = None
    notes: tuple[str, ...] = ()

    @property
    def gap(self) -> float | None:
        """How far from optimal at most, as a share of the makespan; 0 is proven optimal."""
        if self.lower_bound_s is None:
            return None
        makespan_s = self.schedule.makespan_s
        return max(0.0, 1 - self.lower_bound_s / makespan_s) if makespan_s > 0 else 0.0


@dataclass(frozen=True)
class Assignment:
    """What an allocator chose: a robot for every actor, and perhaps in which order they come.

    `sequence` lists all actors; every robot takes its own in that order. Without it the base class
    looks for a good order.
    """

    allocation: Mapping[str, str]
    sequence: tuple[str, ...] | None = None
    lower_bound_s: float | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Circumstances:
    """What counts in an allocation besides plan and world.

    `ready_s` says from when on a robot is free [s from now]; `priority` of a goal decides between
    equal makespans (each step up counts twice); `due_s` says when a goal should be done
    [s from now]. `home` is the robot of each actor in the plan that this is the rest of, and
    `sequence` the order in which they were to begin: few actors should change hands. Actors that
    are `under_way` go on at once.
    """

    ready_s: Mapping[str, float] = field(default_factory=dict)
    priority: Mapping[str, int] = field(default_factory=dict)
    due_s: Mapping[str, float] = field(default_factory=dict)
    home: Mapping[str, str] = field(default_factory=dict)
    sequence: tuple[str, ...] = ()
    under_way: frozenset[str] = frozenset()


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

    plan: Plan
    world: WorldModel
    checked: CheckedPlan
    able: Mapping[str, tuple[str, ...]]
    load: Mapping[str, int]
    apart: frozenset[tuple[str, str]]
    circumstances: Circumstances = field(default_factory=Circumstances)


class Allocator(ABC):
    """Binds actors to robots. Subclasses choose; this class checks what goes in and comes out."""

    name: str
    reschedules = False
    """Whether it heeds `Circumstances.home` itself; for others, whoever can stays where he is."""

    def allocate(
        self, plan: Plan, world: WorldModel, circumstances: Circumstances | None = None
    ) -> Allocated | NotAllocated:
        """A checked allocation of `plan` to the available robots of `world`, or why there is none.

        Tasks of one actor go to one robot, in order; a robot does its actors one after the other.
        """
        told = circumstances or Circumstances()
        if told.home and not self.reschedules:
            stay = {a: robot for a, robot in told.home.items() if robot in world.team}
            actors = task_counts(plan)
            pins = {a: robot for a, robot in {**stay, **plan.pins}.items() if a in actors}
            if pins != plan.pins:
                found = self._allocate(msgspec.structs.replace(plan, pins=pins), world, told)
                if isinstance(found, Allocated):
                    return found
        return self._allocate(plan, world, told)

    def _allocate(
        self, plan: Plan, world: WorldModel, told: Circumstances
    ) -> Allocated | NotAllocated:
        checked = check_plan(plan, world)
        if not checked.valid:
            lacking = tasks_nobody_can_do(plan, checked, world) if checked.actions else ()
            return NotAllocated((*lacking, *checked.violations))
        problem = _problem(plan, world, checked, told)
        chosen = self._assign(problem)
        if isinstance(chosen, NotAllocated):
            return chosen
        if not isinstance(chosen, Assignment):
            chosen = Assignment(chosen)
        found = self._scheduled(problem, chosen)
        if isinstance(found, NotAllocated) and chosen.sequence is not None:
            # What the order's maker did not know of may still work out in another order.
            chosen = replace(chosen, sequence=None)
            found = self._scheduled(problem, chosen)
        return found

    def _scheduled(
        self, problem: AllocationProblem, chosen: Assignment
    ) -> Allocated | NotAllocated:
        plan, world, allocation = problem.plan, problem.world, chosen.allocation
        if chosen.sequence is None:
            told = problem.circumstances
            order = valid_schedule(
                plan, problem.checked, allocation, world, told.under_way, told.ready_s
            )
            if isinstance(order, tuple):
                return NotAllocated(order)
            return Allocated(allocation, order, chosen.lower_bound_s, chosen.notes)
        groups = [(actor,) for actor in chosen.sequence]
        ready_s = problem.circumstances.ready_s
        given = schedule(plan, problem.checked, allocation, world, groups, ready_s)
        if given is None:
            return _refused(f"{self.name}: in this order robots wait for each other for ever")
        final = check_plan(plan, world, allocation, given.extra_after)
        if not final.valid:
            return NotAllocated(final.violations)
        return Allocated(allocation, given, chosen.lower_bound_s, chosen.notes)

    @abstractmethod
    def _assign(self, problem: AllocationProblem) -> Mapping[str, str] | Assignment | NotAllocated:
        """A robot for every actor, among those able; or why there is none."""


def _refused(sentence: str) -> NotAllocated:
    return NotAllocated((Violation(code="no-allocation", sentence=sentence),))


def _problem(
    plan: Plan, world: WorldModel, checked: CheckedPlan, circumstances: Circumstances
) -> AllocationProblem:
    return AllocationProblem(
        plan=plan,
        world=world,
        checked=checked,
        able=able_robots(plan, checked),
        load=task_counts(plan),
        apart=actors_apart(plan, checked),
        circumstances=circumstances,
    )
