"""Round-robin: each actor to the next robot in turn that can be it. A baseline."""

from __future__ import annotations

from fleet.allocators.balanced import load_problem
from fleet.allocators.base import AllocationProblem, Allocator, NotAllocated
from fleet.allocators.load_balancing.apart import why_not_apart
from fleet.allocators.reasons import not_apart

MAX_STEPS = 100_000
"""Robots that are tried for actors, going back included, before it is given up."""


class RoundRobinAllocator(Allocator):
    """Robots take actors in turn, whatever their loads and wherever they are.

    A robot that cannot be an actor, or must be another one than some robot before, is passed over.
    """

    name = "round-robin"

    def _assign(self, problem: AllocationProblem) -> dict[str, str] | NotAllocated:
        return in_turn(problem)


def in_turn(problem: AllocationProblem) -> dict[str, str] | NotAllocated:
    """Every actor's robot: the first in turn that will do.

    Where actors that must be apart leave none, the choice before is taken back, and so on.
    """
    team = problem.world.team
    actors = tuple(problem.able)
    near: dict[str, set[str]] = {actor: set() for actor in actors}
    for one, other in problem.apart:
        near[one].add(other)
        near[other].add(one)
    chosen: dict[str, str] = {}
    tried: list[list[str]] = []
    turn = 0
    steps = 0
    while len(chosen) < len(actors):
        actor = actors[len(chosen)]
        if len(tried) == len(chosen):
            able = set(problem.able[actor])
            tried.append([r for r in (*team[turn:], *team[:turn]) if r in able])
        taken = {chosen.get(other) for other in near[actor]}
        left = tried[-1]
        while left and left[0] in taken:
            left.pop(0)
        steps += 1
        if left:
            chosen[actor] = left.pop(0)
            turn = (team.index(chosen[actor]) + 1) % len(team)
            continue
        tried.pop()
        if not chosen or steps > MAX_STEPS:
            short = why_not_apart(*_numbers(problem))
            return not_apart(problem, [actors[a] for a in short], proven=not chosen)
        chosen.popitem()
    return chosen


def _numbers(problem: AllocationProblem) -> tuple[list[int], frozenset[tuple[int, int]]]:
    made = load_problem(problem)
    return list(made.able), made.apart
