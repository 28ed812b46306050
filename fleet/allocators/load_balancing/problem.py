"""What is balanced, what comes of it, and a reason why nothing may."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from fleet.allocators.load_balancing.robot_sets import bits


@dataclass(frozen=True)
class LoadBalancingProblem:
    """Actors 0…A-1, robots 0…robots-1.

    `able[a]` is the set of robots that can be actor `a`, `load[a]` (at least 1) its tasks; `apart`
    holds pairs of actors that must be different robots.
    """

    able: Sequence[int]
    load: Sequence[int]
    robots: int
    apart: frozenset[tuple[int, int]] = frozenset()

    @cached_property
    def conflicts(self) -> Sequence[set[int]]:
        """For every actor those that must be another robot."""
        found: list[set[int]] = [set() for _ in self.able]
        for one, other in self.apart:
            found[one].add(other)
            found[other].add(one)
        return found


@dataclass(frozen=True)
class BalancedAssignment:
    """A robot for every actor.

    `loads` are the robots' loads, the greatest first. No assignment has a maximum load below
    `lower_bound`; if `optimal`, none has lexicographically lower loads either.
    """

    robot: Sequence[int]
    loads: Sequence[int]
    lower_bound: int
    optimal: bool


@dataclass(frozen=True)
class NoAssignment:
    """No assignment was found; there is none, if `proven`.

    `clique` are actors that must all be different robots and are more than the robots that can be
    any of them. Empty if it is not that simple.
    """

    proven: bool
    clique: tuple[int, ...] = ()


def overfull_clique(problem: LoadBalancingProblem) -> tuple[int, ...]:
    """Actors that are all apart from each other, and more than the robots that can be any of them.

    Empty if no such clique was found; that is no proof that the pairs can be kept apart. Cliques
    are grown greedily from every pair; in a clique, a violated condition of Hall's marriage theorem
    is looked for.
    """
    able, conflicts = problem.able, problem.conflicts
    seen: set[tuple[int, ...]] = set()
    for one, other in sorted(problem.apart):
        clique = [one, other]
        common = conflicts[one] & conflicts[other]
        while common:
            actor = min(common, key=lambda a: (able[a].bit_count(), a))
            clique.append(actor)
            common &= conflicts[actor]
        key = tuple(sorted(clique))
        if key not in seen:
            seen.add(key)
            if found := _hall_violator(clique, able):
                return found
    return ()


def _hall_violator(actors: Sequence[int], able: Sequence[int]) -> tuple[int, ...]:
    """Some of the actors, which fewer robots than they are can be; empty if there are none such.

    Of a maximum matching those that alternating paths reach from an actor without a robot.
    """
    if min(able[actor].bit_count() for actor in actors) >= len(actors):
        return ()
    import numpy as np
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import maximum_bipartite_matching

    rows = [list(bits(able[actor])) for actor in actors]
    robots = [robot for row in rows for robot in row]
    starts = np.cumsum([0, *map(len, rows)])
    graph = csr_array((np.ones(len(robots)), robots, starts), shape=(len(rows), 1 + max(robots)))
    matched = maximum_bipartite_matching(graph, perm_type="column").tolist()
    if -1 not in matched:
        return ()
    actor_of = {robot: i for i, robot in enumerate(matched)}
    reached = [matched.index(-1)]
    for i in reached:
        reached += {actor_of[robot] for robot in rows[i]}.difference(reached)
    return tuple(sorted(actors[i] for i in reached))
