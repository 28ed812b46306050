"""Laws of load balancing, against the paper's program in PuLP and against trying everything."""

from __future__ import annotations

from itertools import combinations, product

import pulp
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fleet.allocators.load_balancing.balance import balance
from fleet.allocators.load_balancing.problem import (
    BalancedAssignment,
    LoadBalancingProblem,
    NoAssignment,
)
from fleet.allocators.load_balancing.robot_sets import bits, classes_of, mask_of, projection
from fleet.allocators.load_balancing.semi_matching import loads_of, semi_matching
from fleet.allocators.min_max_load_milp import MinMaxLoadProgram, solve
from tests.support.reached import Reached, reaches

LIMIT_S = 600.0
"""So small a program takes milliseconds."""
FIVE_IN_A_RING = LoadBalancingProblem(
    [0b11] * 5, [1] * 5, 2, frozenset({(0, 1), (1, 2), (2, 3), (3, 4), (0, 4)})
)
"""No three are all apart, and yet two robots are too few."""


@st.composite
def problems(
    draw: st.DrawFn, actors: int, robots: int, heaviest: int = 1, pairs: int = 0, least: int = 1
) -> LoadBalancingProblem:
    """From `least` to `actors` actors; few different able sets, so that classes have members."""
    count = draw(st.integers(1, robots))
    kinds = draw(st.lists(st.integers(1, 2**count - 1), min_size=1, max_size=4))
    able = draw(st.lists(st.sampled_from(kinds), min_size=least, max_size=actors))
    load = draw(st.lists(st.integers(1, heaviest), min_size=len(able), max_size=len(able)))
    every = list(combinations(range(len(able)), 2))
    apart = draw(st.sets(st.sampled_from(every), max_size=pairs)) if every and pairs else set()
    return LoadBalancingProblem(able, load, count, frozenset(apart))


def check_assignment(problem: LoadBalancingProblem, made: BalancedAssignment) -> None:
    """What holds of every answer."""
    loads = [0] * problem.robots
    for actor, robot in enumerate(made.robot):
        assert problem.able[actor] >> robot & 1
        loads[robot] += problem.load[actor]
    assert sorted(loads, reverse=True) == list(made.loads)
    assert all(made.robot[one] != made.robot[other] for one, other in problem.apart)
    assert made.lower_bound <= made.loads[0]
    assert not made.optimal or made.lower_bound == made.loads[0]


def papers_program(problem: LoadBalancingProblem) -> MinMaxLoadProgram:
    """Named by numbers, without any help from the code under test."""
    program = MinMaxLoadProgram(
        {str(a): tuple(map(str, bits(mask))) for a, mask in enumerate(problem.able)},
        {str(a): load for a, load in enumerate(problem.load)},
        frozenset((str(one), str(other)) for one, other in problem.apart),
    )
    program.minimise_max_load()
    return program


def by_cbc(problem: LoadBalancingProblem) -> int | None:
    """The least maximum load by PuLP's own solver; `None` if there is no assignment."""
    model = papers_program(problem).model
    cbc = pulp.COIN_CMD(path=pulp.PULP_CBC_CMD.pulp_cbc_path, msg=False)  # the one in its wheel
    status = model.solve(cbc)
    assert status in (pulp.LpStatusOptimal, pulp.LpStatusInfeasible)
    return round(model.objective.value()) if status == pulp.LpStatusOptimal else None


def by_scipy(problem: LoadBalancingProblem) -> int | None:
    """The same by the solver of the product."""
    found = solve(papers_program(problem).model, LIMIT_S)
    assert found.proven
    return round(found.values["max_load"]) if found.values else None


def by_force(problem: LoadBalancingProblem) -> list[int] | None:
    """The lexicographically least loads among all assignments."""
    best: list[int] | None = None
    for robot in product(*(list(bits(mask)) for mask in problem.able)):
        if any(robot[one] == robot[other] for one, other in problem.apart):
            continue
        loads = [0] * problem.robots
        for actor, its in enumerate(robot):
            loads[its] += problem.load[actor]
        loads.sort(reverse=True)
        if best is None or loads < best:
            best = loads
    return best


@settings(max_examples=100)
@given(problem=problems(actors=12, robots=5))
def test_unit_tasks_have_the_least_maximum_load_that_the_program_finds(
    problem: LoadBalancingProblem,
) -> None:
    made = balance(problem)
    assert isinstance(made, BalancedAssignment)
    check_assignment(problem, made)
    assert made.optimal
    assert made.loads[0] == by_cbc(problem) == by_scipy(problem)


@reaches("infeasible", "unequal and apart")
@settings(max_examples=100)
@given(problem=problems(actors=8, robots=4, heaviest=5, pairs=5))
def test_unequal_and_apart_actors_have_the_programs_maximum_load(
    reached: Reached, problem: LoadBalancingProblem
) -> None:
    made, least = balance(problem), by_cbc(problem)
    assert least == by_scipy(problem)
    reached["infeasible"] += least is None
    if isinstance(made, NoAssignment):
        assert made.proven and least is None
        return
    check_assignment(problem, made)
    assert made.optimal
    assert made.loads[0] == least
    reached["unequal and apart"] += len(set(problem.load)) > 1 and bool(problem.apart)


@settings(max_examples=300)
@given(problem=problems(actors=6, robots=4))
def test_unit_loads_are_lexicographically_least(problem: LoadBalancingProblem) -> None:
    made = balance(problem)
    assert isinstance(made, BalancedAssignment)
    check_assignment(problem, made)
    assert list(made.loads) == by_force(problem)


@reaches("balanced", "pair", "clique", "no clique")
@settings(max_examples=300)
@example(problem=FIVE_IN_A_RING)
@given(problem=problems(actors=6, robots=4, heaviest=4, pairs=8))
def test_all_loads_of_small_problems_are_lexicographically_least(
    reached: Reached, problem: LoadBalancingProblem
) -> None:
    made, best = balance(problem), by_force(problem)
    if isinstance(made, BalancedAssignment):
        check_assignment(problem, made)
        assert made.optimal
        assert list(made.loads) == best
        reached["balanced"] += bool(problem.apart)
        return
    assert made.proven and best is None
    for actor in made.clique:
        others = {b if a == actor else a for a, b in problem.apart if actor in (a, b)}
        assert set(made.clique) <= others | {actor}
    able = {robot for actor in made.clique for robot in bits(problem.able[actor])}
    assert not made.clique or len(able) < len(made.clique)
    reached["pair" if len(made.clique) == 2 else "clique" if made.clique else "no clique"] += 1


@reaches("large")
@settings(max_examples=60)
@given(problem=problems(actors=90, robots=12, heaviest=7, pairs=30, least=40))
def test_large_answers_are_right_and_their_bound_too(
    reached: Reached, problem: LoadBalancingProblem
) -> None:
    made = balance(problem)
    if isinstance(made, BalancedAssignment):
        check_assignment(problem, made)
        reached["large"] += len(problem.able) > 20


@settings(max_examples=200)
@given(
    counts=st.lists(st.integers(0, 40), min_size=1, max_size=5),
    members=st.lists(st.integers(1, 6), min_size=1, max_size=4),
    data=st.data(),
)
def test_counting_together_is_the_same_as_one_by_one(
    counts: list[int], members: list[int], data: st.DataObject
) -> None:
    able = [data.draw(st.integers(1, 2 ** len(members) - 1)) for _ in counts]
    together = loads_of(semi_matching(counts, able, members), members)
    robots = [j for j, size in enumerate(members) for _ in range(size)]
    alone = [
        mask_of((r for r, j in enumerate(robots) if mask >> j & 1), len(robots))
        for mask, count in zip(able, counts, strict=True)
        for _ in range(count)
    ]
    flow = semi_matching([1] * len(alone), alone, [1] * len(robots))
    assert loads_of(flow, [1] * len(robots)) == together


@settings(max_examples=200)
@given(problem=problems(actors=20, robots=9))
def test_classes_partition_actors_and_robots_and_keep_who_can_be_whom(
    problem: LoadBalancingProblem,
) -> None:
    classes = classes_of(problem.able, problem.robots)
    assert sorted(a for actors in classes.actors for a in actors) == list(range(len(problem.able)))
    assert sorted(r for robots in classes.robots for r in robots) == list(range(problem.robots))
    for actors, mask in zip(classes.actors, classes.able, strict=True):
        wide = {r for j in bits(mask) for r in classes.robots[j]}
        assert all(set(bits(problem.able[a])) == wide for a in actors)
    columns = [tuple(mask >> robots[0] & 1 for mask in problem.able) for robots in classes.robots]
    assert len(set(columns)) == len(columns)


@given(size=st.integers(1, 70), data=st.data())
def test_sets_as_bits(size: int, data: st.DataObject) -> None:
    number = st.integers(0, size - 1)
    chosen = data.draw(st.sets(number))
    wanted = data.draw(st.lists(number, unique=True))
    mask = mask_of(chosen, size)
    assert list(bits(mask)) == sorted(chosen)
    assert set(bits(projection(wanted, size)(mask))) == {
        k for k, number in enumerate(wanted) if number in chosen
    }
