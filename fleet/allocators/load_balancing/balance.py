"""Least maximum load, then least next load, and so on: exact where that can be, bounded elsewhere.

Three ways, the first that fits:

1. Every actor has the same load and none must be apart: an optimal semi-matching, at any size.
2. The relaxation that splits actors into single tasks is an optimal semi-matching again. Its sorted
   loads are majorized by those of every sharing that splits no actor (ibid., theorem 3.5), so none
   is lexicographically less: a sharing that has the same loads is proven to be the best one.
3. With unequal loads the problem holds PARTITION, with pairs apart graph colouring, and is NP-hard:
   longest tasks first (LPT; Graham, "Bounds on multiprocessing timing anomalies", 1969), then hand
   over and swap while that helps, then branch and bound within a number of steps. What is not
   proven then is said, beside the relaxation's maximum, below which nothing can be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from math import gcd

from fleet.allocators.load_balancing.apart import why_not_apart
from fleet.allocators.load_balancing.classes import Classes, classes_of
from fleet.allocators.load_balancing.exact import branch_and_bound
from fleet.allocators.load_balancing.search import Sharing, improve, longest_first
from fleet.allocators.load_balancing.semimatching import Shares, loads_of, semi_matching


@dataclass(frozen=True)
class LoadProblem:
    """Actors 0…A-1, robots 0…robots-1.

    `able[a]` is the set of robots that can be actor `a`, `load[a]` (at least 1) its tasks; `apart`
    holds pairs of actors that must be different robots.
    """

    able: Sequence[int]
    load: Sequence[int]
    robots: int
    apart: frozenset[tuple[int, int]] = frozenset()


@dataclass(frozen=True)
class Balance:
    """A robot for every actor.

    `loads` are the robots' loads, the greatest first. No sharing has a maximum load below
    `least_top`; if `proven`, none has lexicographically lower loads either.
    """

    robot: Sequence[int]
    loads: Sequence[int]
    least_top: int
    proven: bool


@dataclass(frozen=True)
class Unbalanced:
    """No sharing was found; there is none, if `proven`.

    `actors` cannot all be different robots: too few can be any of them. Empty if it is not that
    simple.
    """

    proven: bool
    actors: tuple[int, ...] = ()


def balance(problem: LoadProblem) -> Balance | Unbalanced:
    """Share actors among robots so that the sorted loads are lexicographically least.

    Raises:
        ValueError: an actor has no able robot, or a load below 1.
    """
    if any(load < 1 for load in problem.load):
        raise ValueError("an actor's load must be at least one task")
    if not all(problem.able):
        raise ValueError(f"no robot can be actor {list(problem.able).index(0)}")
    unit = reduce(gcd, problem.load, 0) or 1
    classes = classes_of(problem.able, problem.robots)
    members = [len(robots) for robots in classes.robots]
    counts = [sum(problem.load[a] // unit for a in actors) for actors in classes.actors]
    shares = semi_matching(counts, classes.able, members)
    relaxed = [unit * load for load in loads_of(shares, members)]
    least_top = max(relaxed, default=0)
    alike = all(load == unit for load in problem.load)
    if alike:
        robot = spread(classes, shares)
        if not problem.apart:
            return Balance(robot, relaxed, least_top, proven=True)
    if told := why_not_apart(problem.able, problem.apart):
        return Unbalanced(True, told)
    best: Sharing | None = None
    if alike:
        mended = Sharing.mended(problem.load, problem.robots, problem.apart, robot)
        best = improve(mended, problem.able, relaxed)
    if best is None or best.sorted_loads() != relaxed:
        greedy = longest_first(problem.able, problem.load, problem.robots, problem.apart)
        found = [best, greedy and improve(greedy, problem.able, relaxed)]
        best = min(filter(None, found), key=Sharing.sorted_loads, default=None)
    complete = best is not None and best.sorted_loads() == relaxed
    if not complete:
        best, complete = branch_and_bound(
            problem.able, problem.load, problem.robots, problem.apart, best, relaxed
        )
    if best is None:
        return Unbalanced(complete)
    loads = best.sorted_loads()
    if complete:
        least_top = max(loads)
    return Balance(best.robot, loads, least_top, proven=complete)


def spread(classes: Classes, shares: Shares) -> list[int]:
    """A robot for every actor, from the shares of classes of unit tasks.

    The actors of a robot class are dealt to its robots in turn.
    """
    robot = [0] * sum(len(actors) for actors in classes.actors)
    queues = [iter(actors) for actors in classes.actors]
    for share, members in zip(shares, classes.robots, strict=True):
        turn = 0
        for i, count in share.items():
            for _ in range(count):
                robot[next(queues[i])] = members[turn]
                turn = (turn + 1) % len(members)
    return robot
