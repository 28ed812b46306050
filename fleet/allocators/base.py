"""The allocator interface: actors in, robots out, checked on both sides."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import msgspec

from fleet.core.checker.checked_plan import CheckedPlan, check_allocation, check_plan
from fleet.core.model.world import WorldModel
from fleet.core.schedule.actor_constraints import actors_apart, task_counts
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

    checked: CheckedPlan
    able: Mapping[str, tuple[str, ...]]
    load: Mapping[str, int]
    apart: frozenset[tuple[str, str]]
    circumstances: Circumstances = field(default_factory=Circumstances)

    @property
    def plan(self) -> Plan:
        """The plan to be allocated."""
        return self.checked.plan

    @property
    def world(self) -> WorldModel:
        """The world that the plan is valid in."""
        return self.checked.world


class Allocator(ABC):
    """Binds actors to robots. Subclasses choose; this class checks what they chose."""

    name: str
    reschedules = False
    """Whether it heeds `Circumstances.home` itself; for others, whoever can stays where he is."""

    def allocate(
        self, checked: CheckedPlan, circumstances: Circumstances | None = None
    ) -> Allocated | NotAllocated:
        """A checked allocation of a plan to the connected robots of its world, or why none.

        Tasks of one actor go to one robot, in order; a robot does its actors one after the other.
        """
        circumstances = circumstances or Circumstances()
        if circumstances.home and not self.reschedules:
            plan, team = checked.plan, checked.world.team
            pins = {a: robot for a, robot in circumstances.home.items() if robot in team}
            pins = {a: robot for a, robot in {**pins, **plan.pins}.items() if a in plan.actors}
            if pins != plan.pins:
                pinned = check_plan(msgspec.structs.replace(plan, pins=pins), checked.world)
                if isinstance(pinned, CheckedPlan):
                    found = self._allocate(pinned, circumstances)
                    if isinstance(found, Allocated):
                        return found
        return self._allocate(checked, circumstances)

    def _allocate(
        self, checked: CheckedPlan, circumstances: Circumstances
    ) -> Allocated | NotAllocated:
        problem = AllocationProblem(
            checked=checked,
            able=checked.able,
            load=task_counts(checked.plan),
            apart=actors_apart(checked),
            circumstances=circumstances,
        )
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
        checked, allocation = problem.checked, chosen.allocation
        ready_s = problem.circumstances.ready_s
        if chosen.sequence is None:
            order = valid_schedule(checked, allocation, problem.circumstances.under_way, ready_s)
            if isinstance(order, tuple):
                return NotAllocated(order)
            return Allocated(allocation, order, chosen.lower_bound_s, chosen.notes)
        groups = [(actor,) for actor in chosen.sequence]
        given = schedule(checked, allocation, groups, ready_s)
        if given is None:
            sentence = f"{self.name}: in this order robots wait for each other for ever"
            return NotAllocated((Violation(code="no-allocation", sentence=sentence),))
        if violations := check_allocation(
            problem.plan, problem.world, allocation, given.extra_after
        ):
            return NotAllocated(violations)
        return Allocated(allocation, given, chosen.lower_bound_s, chosen.notes)

    @abstractmethod
    def _assign(self, problem: AllocationProblem) -> Mapping[str, str] | Assignment | NotAllocated:
        """A robot for every actor, among those able; or why there is none."""
