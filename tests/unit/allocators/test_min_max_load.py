"""The allocator of least maximum load, and the paper's program in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import pytest

from fleet.allocators import min_max_load
from fleet.allocators.base import Allocated, AllocationProblem, Assignment, NotAllocated
from fleet.allocators.min_max_load import (
    MinMaxLoadAllocator,
    TieBreak,
    assign_balanced,
    assign_with_least_travel,
    in_turn_instead,
)
from fleet.allocators.min_max_load_milp import MinMaxLoadProgram, max_load, solve
from fleet.core.model.world import WorldModel
from fleet.service.composition import compose
from keyexpr_schema.payloads.plans import Violation
from tests.support.household import checked, drives, fact, home, manipulator

PLACES = ("kitchen", "hallway", "living_room")


def team_of(robots: int) -> WorldModel:
    """Alike robots, here and there."""
    names = [f"r{n}" for n in range(robots)]
    facts = tuple(fact(name, "at", PLACES[n % 3]) for n, name in enumerate(names))
    return home(tuple(map(manipulator, names)), facts=facts)


def problem_of(world: WorldModel, *load: int) -> AllocationProblem:
    """An actor with so many tasks for each load; any robot can be any actor."""
    plan = drives(*[""] * len(load))
    return AllocationProblem(
        checked=checked(plan, world),
        able={f"a{n}": tuple(world.team) for n in range(len(load))},
        load={f"a{n}": tasks for n, tasks in enumerate(load)},
        apart=frozenset(),
    )


def test_the_milp_breaks_ties_by_travel() -> None:
    world = home(
        (manipulator("r1"), manipulator("r2")),
        facts=(fact("r1", "at", "living_room"), fact("r2", "at", "kitchen")),
    )
    made = MinMaxLoadAllocator(TieBreak.TRAVEL).allocate(checked(drives(""), world))
    assert isinstance(made, Allocated)
    assert made.allocation == {"a0": "r2"}


@pytest.mark.parametrize("assign", [assign_balanced, assign_with_least_travel])
def test_what_is_not_proven_is_noted(
    assign: Callable[[AllocationProblem], Assignment | NotAllocated],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Weights without a pattern, so many that no search gets through."""
    monkeypatch.setattr(min_max_load, "IMPROVE_LIMIT_S", 0.0)
    made = assign(problem_of(team_of(9), *(61 + n * n % 37 for n in range(33))))
    assert isinstance(made, Assignment)
    assert "proven" in made.notes[0]


def test_many_robots_that_are_alike_do_not_keep_the_solver_busy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """202 tasks and 20 robots took the solver alone 20 s."""
    monkeypatch.setattr(min_max_load, "TRAVEL_LIMIT_S", 600.0)
    problem = problem_of(team_of(20), *[1] * 202)
    travel_s = problem.approach_s()
    balanced, near = assign_balanced(problem), assign_with_least_travel(problem, 600.0)
    assert isinstance(balanced, Assignment) and isinstance(near, Assignment)
    assert near.notes == ()
    assert max_load(balanced.allocation, problem.load) == 11
    assert max_load(near.allocation, problem.load) == 11
    before_s, after_s = (
        sum(travel_s[pair] for pair in found.allocation.items()) for found in (balanced, near)
    )
    assert after_s < before_s


def test_what_is_too_large_for_the_solver_is_balanced_without_it() -> None:
    made = assign_with_least_travel(problem_of(team_of(250), *[1] * 1000))
    assert isinstance(made, Assignment)
    assert "too many for the solver" in made.notes[0]
    assert set(Counter(made.allocation.values()).values()) == {4}


def test_the_papers_fallback_is_an_allocator_of_its_own_and_says_so() -> None:
    refused = NotAllocated((Violation(code="no-allocation", sentence="nothing found in time"),))
    made = in_turn_instead(problem_of(team_of(2), 1, 1), refused)
    assert isinstance(made, Assignment)
    assert made.allocation == {"a0": "r0", "a1": "r1"}
    assert made.notes == ("allocated by round-robin and not by the MILP: nothing found in time",)
    offered = compose().allocators
    for name in ("balanced", "milp", "milp-or-round-robin"):
        assert type(offered[name]) is MinMaxLoadAllocator


def test_the_solver_keeps_standard_output_clean_and_says_what_it_found(
    capfd: pytest.CaptureFixture[str],
) -> None:
    able = {f"a{n}": ("r1", "r2", "r3") for n in range(8)}
    load = dict.fromkeys(able, 1)
    program = MinMaxLoadProgram(able, load)
    program.minimise_max_load()
    found = solve(program.model, limit_s=60.0)
    assert found.proven and found.values
    assert found.values["max_load"] == max_load(program.robots(found.values), load) == 3
    pair = MinMaxLoadProgram(
        {"a": ("r1",), "b": ("r1",)}, {"a": 1, "b": 1}, frozenset({("a", "b")})
    )
    pair.minimise_max_load()
    impossible = solve(pair.model, limit_s=60.0)
    assert impossible.proven and not impossible.values
    assert capfd.readouterr() == ("", "")


def test_a_solver_without_time_does_not_claim_an_optimum() -> None:
    """Weights without a pattern: no bound meets a solution before the search."""
    able = {f"a{n}": tuple(f"r{r}" for r in range(9)) for n in range(33)}
    program = MinMaxLoadProgram(able, {f"a{n}": 61 + n * n % 37 for n in range(33)})
    program.minimise_max_load()
    assert not solve(program.model, limit_s=0.0).proven


def test_the_solver_takes_any_linear_program_in_pulp() -> None:
    import pulp

    model = pulp.LpProblem("m", pulp.LpMinimize)
    x, y = model.add_variable("x", lowBound=1), model.add_variable("y", cat="Integer")
    model += x + y
    model += 2 * y >= 5 - x
    model += x <= 1.5
    found = solve(model, limit_s=60.0)
    assert found.proven and found.values
    assert found.values == pytest.approx({"x": 1.0, "y": 2.0})
