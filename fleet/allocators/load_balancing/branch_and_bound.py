"""The evenest loads of all, by branch and bound, where there are few enough actors for it.

Steps are counted and not seconds, so that the same problem has the same answer.
"""

from __future__ import annotations

from collections.abc import Sequence

from fleet.allocators.load_balancing.local_search import PartialAssignment
from fleet.allocators.load_balancing.problem import LoadBalancingProblem
from fleet.allocators.load_balancing.robot_sets import bits

SEARCH_STEPS = 400_000
"""Choices of a robot for an actor that branch and bound weighs at most: about half a second."""
SEARCH_ACTORS = 60
"""With more actors, branch and bound has no hope of proving anything in so few steps."""
FEASIBLE_ACTORS = 400
"""With more actors it is not even used to find any assignment: it is as deep as there are many."""


def branch_and_bound(
    problem: LoadBalancingProblem, incumbent: PartialAssignment | None, relaxed: Sequence[int]
) -> tuple[PartialAssignment | None, bool]:
    """The best assignment of all, if the search gets through; else the best one met.

    No sorted loads are below `relaxed`. Returns the assignment (`None`: there is none, or none was
    met) and whether it is proven.
    """
    if len(problem.load) > (FEASIBLE_ACTORS if incumbent is None else SEARCH_ACTORS):
        return incumbent, False
    search = _Search(problem, incumbent, relaxed)
    complete = search.go()
    return (None if search.best is None else PartialAssignment(problem, search.robot)), complete


class _Search:
    """Depth first: the actor with the fewest robots left, on the robot with the least load first.

    A partial assignment's sorted loads only grow, so one that is not below the best is left.
    """

    def __init__(
        self,
        problem: LoadBalancingProblem,
        incumbent: PartialAssignment | None,
        relaxed: Sequence[int],
    ) -> None:
        self.partial = PartialAssignment(problem)
        self.relaxed = relaxed
        self.best: list[int] | None = None
        self.robot: list[int] = []
        if incumbent is not None:
            self.best, self.robot = incumbent.sorted_loads(), list(incumbent.robot)
        self.steps = 0
        self.left = set(range(len(problem.able)))
        alike: dict[tuple[bool, ...], int] = {}
        self.kind = [
            alike.setdefault(tuple(bool(mask >> robot & 1) for mask in problem.able), robot)
            for robot in range(problem.robots)
        ]

    def go(self) -> bool:
        """Search below the partial assignment; whether all of it was looked at."""
        partial = self.partial
        if self.best is not None and (
            self.best == self.relaxed or partial.sorted_loads() >= self.best
        ):
            return True
        if not self.left:
            self.best, self.robot = partial.sorted_loads(), list(partial.robot)
            return True
        if self.steps > SEARCH_STEPS:
            return False
        actor, choices = self._branches()
        self.left.remove(actor)
        complete = True
        tried: set[tuple[int, int]] = set()
        for robot in choices:
            # Robots alike with alike loads are one choice; with actors apart, only idle ones are.
            same = (self.kind[robot], partial.loads[robot])
            if same in tried and not (partial.problem.apart and partial.loads[robot]):
                continue
            tried.add(same)
            partial.assign(actor, robot)
            complete = self.go() and complete
            if not complete and self.steps > SEARCH_STEPS:
                break
        partial.assign(actor, -1)
        self.left.add(actor)
        return complete

    def _branches(self) -> tuple[int, list[int]]:
        partial = self.partial
        rated = []
        for actor in self.left:
            free = list(bits(partial.free(actor)))
            self.steps += 1 + len(free)
            rated.append((len(free), -partial.problem.load[actor], actor, free))
        _, _, actor, free = min(rated)
        return actor, sorted(free, key=partial.loads.__getitem__)
