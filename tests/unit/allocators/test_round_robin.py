"""Round-robin, and where it falls short."""

from __future__ import annotations

from fleet.allocators.base import Allocated
from fleet.allocators.min_max_load import MinMaxLoadAllocator, TieBreak
from fleet.allocators.round_robin import RoundRobinAllocator
from keyexpr_schema.payloads.plans import Plan
from tests.support.household import carrier, checked, drives, home, manipulator

TEAM = (manipulator("r1"), manipulator("r2"), manipulator("r3"), carrier("c1"), carrier("c2"))


def loads(plan: Plan, made: Allocated) -> list[int]:
    found = dict.fromkeys(made.allocation.values(), 0)
    for task in plan.tasks:
        found[made.allocation[task.actor]] += 1
    return sorted(found.values(), reverse=True)


def test_the_evenest_loads_are_found_where_round_robin_misses_them() -> None:
    """Free actors come first in turn, and take the one robot that the pinned ones need."""
    world = home((manipulator("r1"), manipulator("r2")))
    plan = drives("", "", "r1", "r1")
    even = MinMaxLoadAllocator(TieBreak.NEXT_LOADS).allocate(checked(plan, world))
    turn = RoundRobinAllocator().allocate(checked(plan, world))
    assert isinstance(even, Allocated) and isinstance(turn, Allocated)
    assert loads(plan, even) == [2, 2]
    assert loads(plan, turn) == [3, 1]


def test_round_robin_goes_on_where_it_stopped() -> None:
    made = RoundRobinAllocator().allocate(checked(drives(*[""] * 7), home(TEAM)))
    assert isinstance(made, Allocated)
    assert list(made.allocation.values()) == ["c1", "c2", "r1", "r2", "r3", "c1", "c2"]
