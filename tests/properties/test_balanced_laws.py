"""Laws of the load balancing, against the paper's MILP and against trying everything."""

from __future__ import annotations

from itertools import product

from fleet.allocators.load_balancing.bits import bits, mask_of, selector
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.allocators.load_balancing import (
    Balance,
    LoadProblem,
    Unbalanced,
    balance,
    classes_of,
    classes_of_needs,
    loads_of,
    semi_matching,
)
from fleet.allocators.min_max_load import Bound, min_max_load


@st.composite
def problems(
    draw: st.DrawFn, actors: int, robots: int, heaviest: int = 1, pairs: int = 0
) -> LoadProblem:
    """Small problems; few different able sets, so that classes have more than one member."""
    count = draw(st.integers(1, robots))
    kinds = draw(st.lists(st.integers(1, 2**count - 1), min_size=1, max_size=4))
    able = draw(st.lists(st.sampled_from(kinds), min_size=1, max_size=actors))
    load = draw(st.lists(st.integers(1, heaviest), min_size=len(able), max_size=len(able)))
    some = st.integers(0, len(able) - 1)
    apart = draw(st.lists(st.tuples(some, some), max_size=pairs))
    return LoadProblem(able, load, count, frozenset((a, b) for a, b in apart if a < b))


def checked(problem: LoadProblem, made: Balance) -> None:
    """What holds of every answer."""
    loads = [0] * problem.robots
    for actor, robot in enumerate(made.robot):
        assert problem.able[actor] >> robot & 1
        loads[robot] += problem.load[actor]
    assert sorted(loads, reverse=True) == list(made.loads)
    assert all(made.robot[one] != made.robot[other] for one, other in problem.apart)
    assert made.least_top <= made.loads[0]
    assert not made.proven or made.least_top == made.loads[0]


def by_milp(problem: LoadProblem) -> int | None:
    """The least maximum load, found without any help from the code under test."""
    able = {str(a): tuple(map(str, bits(mask))) for a, mask in enumerate(problem.able)}
    load = {str(a): load for a, load in enumerate(problem.load)}
    apart = frozenset((str(one), str(other)) for one, other in problem.apart)
    made = min_max_load(able, load, apart, Bound(), limit_s=20.0)
    assert made.proven
    return None if made.robot is None else made.top


def by_force(problem: LoadProblem) -> list[int] | None:
    """The lexicographically least loads among all sharings."""
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


@settings(max_examples=150, deadline=None)
@given(problem=problems(actors=12, robots=5))
def test_unit_tasks_have_the_least_maximum_load_that_the_milp_finds(problem: LoadProblem) -> None:
    made = balance(problem)
    assert isinstance(made, Balance)
    checked(problem, made)
    assert made.proven
    assert made.loads[0] == by_milp(problem)


@settings(max_examples=100, deadline=None)
@given(problem=problems(actors=8, robots=4, heaviest=5, pairs=5))
def test_unequal_and_apart_actors_have_the_milps_maximum_load(problem: LoadProblem) -> None:
    made = balance(problem)
    least = by_milp(problem)
    if isinstance(made, Unbalanced):
        assert made.proven and least is None
        return
    checked(problem, made)
    assert made.proven
    assert made.loads[0] == least


@settings(max_examples=300, deadline=None)
@given(problem=problems(actors=6, robots=4, heaviest=1))
def test_unit_loads_are_lexicographically_least(problem: LoadProblem) -> None:
    made = balance(problem)
    assert isinstance(made, Balance)
    checked(problem, made)
    assert list(made.loads) == by_force(problem)


@settings(max_examples=300, deadline=None)
@given(problem=problems(actors=6, robots=4, heaviest=4, pairs=6))
def test_all_loads_of_small_problems_are_lexicographically_least(problem: LoadProblem) -> None:
    made, best = balance(problem), by_force(problem)
    if isinstance(made, Unbalanced):
        assert made.proven and best is None
        for actor in made.actors:
            others = {b if a == actor else a for a, b in problem.apart if actor in (a, b)}
            assert set(made.actors) <= others | {actor}
        together = 0
        for actor in made.actors:
            together |= problem.able[actor]
        assert not made.actors or together.bit_count() < len(made.actors)
    else:
        checked(problem, made)
        assert made.proven
        assert list(made.loads) == best


@settings(max_examples=60, deadline=None)
@given(problem=problems(actors=120, robots=12, heaviest=7, pairs=40))
def test_large_answers_are_right_and_their_bound_too(problem: LoadProblem) -> None:
    made = balance(problem)
    if isinstance(made, Balance):
        checked(problem, made)


@settings(max_examples=200, deadline=None)
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
    shares = semi_matching([1] * len(alone), alone, [1] * len(robots))
    assert loads_of(shares, [1] * len(robots)) == together


@settings(max_examples=200, deadline=None)
@given(problem=problems(actors=20, robots=9))
def test_classes_partition_actors_and_robots_and_keep_who_can_be_whom(problem: LoadProblem) -> None:
    classes = classes_of(problem.able, problem.robots)
    assert sorted(a for actors in classes.actors for a in actors) == list(range(len(problem.able)))
    assert sorted(r for robots in classes.robots for r in robots) == list(range(problem.robots))
    for actors, mask in zip(classes.actors, classes.able, strict=True):
        wide = {r for j in bits(mask) for r in classes.robots[j]}
        assert all(set(bits(problem.able[a])) == wide for a in actors)
    columns = [tuple(mask >> robots[0] & 1 for mask in problem.able) for robots in classes.robots]
    assert len(set(columns)) == len(columns)


@settings(max_examples=100, deadline=None)
@given(
    needs=st.lists(st.frozensets(st.integers(0, 4), max_size=3), min_size=1, max_size=12),
    kinds=st.lists(st.frozensets(st.integers(0, 4)), min_size=1, max_size=6),
)
def test_classes_from_needs_give_the_same_loads(
    needs: list[frozenset[int]], kinds: list[frozenset[int]]
) -> None:
    needs = [need for need in needs if any(need <= kind for kind in kinds)]
    classes = classes_of_needs(needs, kinds, frozenset.issubset)
    members = [len(robots) for robots in classes.robots]
    shares = semi_matching([len(actors) for actors in classes.actors], classes.able, members)
    able = [mask_of((r for r, k in enumerate(kinds) if need <= k), len(kinds)) for need in needs]
    made = balance(LoadProblem(able, [1] * len(needs), len(kinds)))
    assert isinstance(made, Balance)
    assert loads_of(shares, members) == list(made.loads)


@given(size=st.integers(1, 70), data=st.data())
def test_sets_as_bits(size: int, data: st.DataObject) -> None:
    number = st.integers(0, size - 1)
    chosen = data.draw(st.sets(number))
    wanted = data.draw(st.lists(number, unique=True))
    mask = mask_of(chosen, size)
    assert list(bits(mask)) == sorted(chosen)
    assert set(bits(selector(wanted, size)(mask))) == {
        k for k, number in enumerate(wanted) if number in chosen
    }
