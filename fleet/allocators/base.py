"""The allocator interface: actors in, robots out, checked on both sides."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

from fleet.core.binding import able_robots, actors_apart, task_counts
from fleet.core.checker import CheckedPlan, check_plan
from fleet.core.schedule import Schedule, best_schedule
from fleet.core.world_model import WorldModel
from keyexpr_schema.plans import Plan, Violation


@dataclass(frozen=True)
class Allocated:
    """A plan with a robot for every actor and an order of actors for every robot."""

    allocation: Mapping[str, str]
    schedule: Schedule


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


class Allocator(ABC):
    """Binds actors to robots. Subclasses choose; this class checks what goes in and comes out."""

    name: str

    def allocate(self, plan: Plan, world: WorldModel) -> Allocated | NotAllocated:
        """A checked allocation of `plan` to the available robots of `world`, or why there is none.

        Tasks of one actor go to one robot, in order; a robot does its actors one after the other.
        """
        checked = check_plan(plan, world)
        if not checked.valid:
            return NotAllocated(checked.violations)
        problem = _problem(plan, world, checked)
        chosen = self._assign(problem)
        if isinstance(chosen, NotAllocated):
            return chosen
        schedule = best_schedule(plan, checked, chosen, world)
        if schedule is None:
            return _refused(
                f"{self.name}: with this allocation robots wait for each other for ever"
            )
        final = check_plan(plan, world, chosen, schedule.extra_after)
        if not final.valid:
            return NotAllocated(final.violations)
        return Allocated(chosen, schedule)

    @abstractmethod
    def _assign(self, problem: AllocationProblem) -> dict[str, str] | NotAllocated:
        """A robot for every actor, among those able; or why there is none."""


def _refused(sentence: str) -> NotAllocated:
    return NotAllocated((Violation(code="no-allocation", sentence=sentence),))


def _problem(plan: Plan, world: WorldModel, checked: CheckedPlan) -> AllocationProblem:
    return AllocationProblem(
        plan=plan,
        world=world,
        checked=checked,
        able=able_robots(plan, checked, world),
        load=task_counts(plan),
        apart=actors_apart(plan, checked),
    )
