"""Laws of the allocators of least maximum load, against every allocation there is."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.allocators import min_max_load
from fleet.allocators.base import AllocationProblem, Assignment, NotAllocated
from fleet.allocators.cost_based import assign_in_rounds
from fleet.allocators.min_max_load import assign_balanced, assign_with_least_travel
from fleet.allocators.round_robin import assign_in_turn
from tests.support.household import checked, drives, fact, home, manipulator
from tests.support.reached import Reached, reaches

ROBOTS = {"r0": "kitchen", "r1": "hallway", "r2": "living_room"}
WORLD = home(
    tuple(map(manipulator, ROBOTS)),
    facts=tuple(fact(robot, "at", place) for robot, place in ROBOTS.items()),
)

LIMIT_S = 600.0
"""So small a program takes milliseconds."""


@st.composite
def problems(draw: st.DrawFn) -> AllocationProblem:
    """Up to five drives; who can be whom, the loads and who must be apart are made up."""
    actors = [f"a{i}" for i in range(draw(st.integers(1, 5)))]
    plan = drives(*[""] * len(actors))
    some = st.lists(st.sampled_from(sorted(ROBOTS)), min_size=1, unique=True).map(sorted)
    pairs = [(a, b) for i, a in enumerate(actors) for b in actors[i + 1 :]]
    return AllocationProblem(
        checked=checked(plan, WORLD),
        able={actor: tuple(draw(some)) for actor in actors},
        load={actor: draw(st.integers(1, 6)) for actor in actors},
        apart=frozenset(draw(st.lists(st.sampled_from(pairs), max_size=4)) if pairs else ()),
    )


def every_allocation(problem: AllocationProblem) -> list[dict[str, str]]:
    found = []
    for robots in product(*problem.able.values()):
        chosen = dict(zip(problem.able, robots, strict=True))
        if all(chosen[one] != chosen[other] for one, other in problem.apart):
            found.append(chosen)
    return found


def sorted_loads(problem: AllocationProblem, chosen: dict[str, str]) -> list[int]:
    loads = dict.fromkeys(ROBOTS, 0)
    for actor, robot in chosen.items():
        loads[robot] += problem.load[actor]
    return sorted(loads.values(), reverse=True)


def objective(tie_break: str, problem: AllocationProblem, chosen: dict[str, str]) -> list[float]:
    """What an allocation is judged by, the least first."""
    loads = sorted_loads(problem, chosen)
    if tie_break == "next loads":
        return list(loads)
    ways_s = problem.approach_s()
    return [loads[0], sum(ways_s[pair] for pair in chosen.items())]


@pytest.mark.parametrize(
    ("tie_break", "assign"),
    [
        ("next loads", assign_balanced),
        ("travel", partial(assign_with_least_travel, time_limit_s=LIMIT_S)),
    ],
)
@reaches("none possible", "decided by the tie-break")
@settings(max_examples=80)
@given(problems())
def test_no_allocation_is_better(
    reached: Reached,
    tie_break: str,
    assign: Callable[[AllocationProblem], Assignment | NotAllocated],
    monkeypatch: pytest.MonkeyPatch,
    problem: AllocationProblem,
) -> None:
    monkeypatch.setattr(min_max_load, "TRAVEL_LIMIT_S", LIMIT_S)
    possible = every_allocation(problem)
    found = assign(problem)
    if isinstance(found, NotAllocated):
        assert possible == []
        reached["none possible"] += 1
        return
    assert found.notes == ()
    chosen = dict(found.allocation)
    assert chosen in possible
    values = sorted(objective(tie_break, problem, other) for other in possible)
    assert objective(tie_break, problem, chosen) == pytest.approx(values[0], rel=1e-3)
    reached["decided by the tie-break"] += values[0][0] == values[-1][0] or (
        len({tuple(value) for value in values if value[0] == values[0][0]}) > 1
    )


@pytest.mark.parametrize("assign", [assign_in_turn, assign_in_rounds])
@reaches("none possible", "apart")
@settings(max_examples=100)
@given(problems())
def test_the_others_find_an_allocation_where_there_is_one(
    reached: Reached,
    assign: Callable[[AllocationProblem], Assignment | NotAllocated],
    problem: AllocationProblem,
) -> None:
    possible = every_allocation(problem)
    found = assign(problem)
    if isinstance(found, NotAllocated):
        assert possible == []
        reached["none possible"] += 1
        return
    assert dict(found.allocation) in possible
    reached["apart"] += bool(problem.apart)
