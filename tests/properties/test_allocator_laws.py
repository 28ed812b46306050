"""Laws of the MILP allocator, against every allocation there is."""

from __future__ import annotations

from collections import Counter
from itertools import product
from types import SimpleNamespace
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.allocators.base import AllocationProblem, NotAllocated
from fleet.allocators.milp import MilpAllocator
from keyexpr_schema.payloads.plans import Plan

ROBOTS = ("r0", "r1", "r2")


@st.composite
def problems(draw: st.DrawFn) -> AllocationProblem:
    actors = [f"a{i}" for i in range(draw(st.integers(1, 5)))]
    some = st.lists(st.sampled_from(ROBOTS), min_size=1, unique=True).map(sorted)
    pairs = [(a, b) for i, a in enumerate(actors) for b in actors[i + 1 :]]
    plan = Plan(plan="p", goals=(), conditions=(), tasks=())
    checked: Any = SimpleNamespace(plan=plan, world=SimpleNamespace(team=ROBOTS))
    return AllocationProblem(
        checked=checked,
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


def busiest(problem: AllocationProblem, chosen: dict[str, str]) -> int:
    load: Counter[str] = Counter()
    for actor, robot in chosen.items():
        load[robot] += problem.load[actor]
    return max(load.values())


@settings(max_examples=60, deadline=None)
@given(problems())
def test_no_allocation_keeps_the_busiest_robot_less_busy(problem: AllocationProblem) -> None:
    possible = every_allocation(problem)
    chosen = MilpAllocator()._assign(problem)
    if isinstance(chosen, NotAllocated):
        assert possible == []
        return
    assert chosen in possible
    assert busiest(problem, chosen) == min(busiest(problem, other) for other in possible)
