"""Rounds of linear assignment by travel."""

from __future__ import annotations

from dataclasses import replace

from fleet.allocators.base import Allocated, AllocationProblem, Assignment
from fleet.allocators.cost_based import CostBasedAllocator, assign_in_rounds
from tests.support.household import checked, drives, fact, home, manipulator

TEAM = (manipulator("r1"), manipulator("r2"), manipulator("r3"))


def test_cost_based_sends_the_robot_that_is_there() -> None:
    world = home(
        TEAM,
        facts=(
            fact("r1", "at", "living_room"),
            fact("r2", "at", "kitchen"),
            fact("r3", "at", "hallway"),
        ),
    )
    # The second drive waits for the first, so it is of the next round: r2 is still the nearest.
    made = CostBasedAllocator().allocate(checked(drives("", "", after={1: ("t0",)}), world))
    assert isinstance(made, Allocated)
    assert made.allocation == {"a0": "r2", "a1": "r2"}
    # In one round every robot takes one at most.
    made = CostBasedAllocator().allocate(checked(drives("", ""), world))
    assert isinstance(made, Allocated)
    assert set(made.allocation.values()) == {"r2", "r3"}


def test_cost_based_says_so_where_its_rounds_leave_no_robot() -> None:
    """a0 takes the near r1 in the first round, which a1 must be and must not be with a0."""
    world = home(TEAM[:2], facts=(fact("r1", "at", "kitchen"), fact("r2", "at", "hallway")))
    plan = drives("", "r1", after={1: ("t0",)})
    problem = AllocationProblem(
        checked=checked(plan, world),
        able={"a0": ("r1", "r2"), "a1": ("r1",)},
        load={"a0": 1, "a1": 1},
        apart=frozenset({("a0", "a1")}),
    )
    made = assign_in_rounds(problem)
    assert isinstance(made, Assignment)
    assert made.allocation == {"a0": "r2", "a1": "r1"}
    assert made.notes[0].startswith("allocated by load and not by travel")
    together = assign_in_rounds(replace(problem, apart=frozenset()))
    assert isinstance(together, Assignment)
    assert together.allocation == {"a0": "r1", "a1": "r1"}
