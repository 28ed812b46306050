"""Round-robin: each actor to the next robot in turn that can be it. A baseline."""

from __future__ import annotations

from bisect import bisect_left

from fleet.allocators.balancing_problem import balancing_problem, explanation, named
from fleet.allocators.base import AllocationProblem, Allocator, Assignment, NotAllocated
from fleet.allocators.load_balancing.local_search import PartialAssignment
from fleet.allocators.load_balancing.problem import NoAssignment, overfull_clique
from fleet.allocators.load_balancing.robot_sets import bits

MAX_STEPS = 100_000
"""Robots that are tried for actors, backtracking included, before it is given up."""


class RoundRobinAllocator(Allocator):
    """Robots take actors in turn, whatever their loads and wherever they are.

    A robot that cannot be an actor, or must be another one than some robot before, is passed over.
    """

    name = "round-robin"

    def _assign(self, problem: AllocationProblem) -> Assignment | NotAllocated:
        return assign_in_turn(problem)


def assign_in_turn(problem: AllocationProblem) -> Assignment | NotAllocated:
    """Every actor's robot: the first in turn that will do.

    Where actors that must be apart leave none, the choice before is taken back, and so on.
    """
    numbers = balancing_problem(problem)
    partial = PartialAssignment(numbers)
    untried: list[list[int]] = []
    actor = first = steps = 0
    while actor < len(numbers.able):
        if len(untried) == actor:
            able = list(bits(numbers.able[actor]))
            turn = bisect_left(able, first)
            untried.append([*able[turn:], *able[:turn]])
        robots = untried[-1]
        while robots and not partial.fits(actor, robots[0]):
            robots.pop(0)
        steps += 1
        if robots:
            partial.assign(actor, robots[0])
            first = robots.pop(0) + 1
            actor += 1
            continue
        untried.pop()
        if not actor or steps > MAX_STEPS:
            return explanation(problem, NoAssignment(not actor, overfull_clique(numbers)))
        actor -= 1
        partial.assign(actor, -1)
    return Assignment(named(problem, partial.robot))
