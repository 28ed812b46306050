"""The best sharing of all, by branch and bound, where there are few enough actors for it.

Steps are counted and not seconds, so that the same problem has the same answer.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from fleet.allocators.load_balancing.apart import neighbours
from fleet.allocators.load_balancing.bits import bits
from fleet.allocators.load_balancing.search import Sharing, taken

SEARCH_STEPS = 400_000
"""Choices of a robot for an actor that branch and bound weighs at most: about half a second."""
SEARCH_ACTORS = 60
"""With more actors, branch and bound has no hope of proving anything in so few steps."""
FEASIBLE_ACTORS = 400
"""With more actors it is not even used to find any sharing: it is as deep as there are actors."""


def branch_and_bound(
    able: Sequence[int],
    load: Sequence[int],
    robots: int,
    apart: Collection[tuple[int, int]],
    best: Sharing | None,
    relaxed: Sequence[int],
) -> tuple[Sharing | None, bool]:
    """The best sharing of all, if the search gets through; else the best one met.

    Returns it (`None`: there is none, or none was met) and whether it is proven.
    """
    if len(load) > (FEASIBLE_ACTORS if best is None else SEARCH_ACTORS):
        return best, False
    search = _Search(able, Sharing(load, robots, neighbours(apart, len(load))), relaxed)
    if best is not None:
        search.best, search.best_robot = best.sorted_loads(), list(best.robot)
    complete = search.go()
    if search.best_robot is None:
        return None, complete
    made = Sharing(load, robots, neighbours(apart, len(load)))
    for actor, robot in enumerate(search.best_robot):
        made.put(actor, robot)
    return made, complete


class _Search:
    """Depth first: the actor with the fewest robots left, on the robot with the least load first.

    A partial sharing's sorted loads only grow, so one that is not below the best is left.
    """

    def __init__(self, able: Sequence[int], partial: Sharing, relaxed: Sequence[int]) -> None:
        self.able = able
        self.partial = partial
        self.relaxed = relaxed
        self.best: list[int] | None = None
        self.best_robot: list[int] | None = None
        self.steps = 0
        self.left = set(range(len(able)))
        alike: dict[tuple[bool, ...], int] = {}
        self.kind = [
            alike.setdefault(tuple(bool(mask >> robot & 1) for mask in able), robot)
            for robot in range(len(partial.loads))
        ]
        self.apart = any(partial.near)

    def go(self) -> bool:
        """Search below the partial sharing; whether all of it was looked at."""
        partial = self.partial
        if self.best is not None:
            if self.best == self.relaxed:
                return True
            if partial.sorted_loads() >= self.best:
                return True
        if not self.left:
            self.best, self.best_robot = partial.sorted_loads(), list(partial.robot)
            return True
        if self.steps > SEARCH_STEPS:
            return False
        actor, choices = self._next()
        self.left.remove(actor)
        complete = True
        tried: set[tuple[int, int]] = set()
        for robot in choices:
            # Robots alike with alike loads are one choice; with actors apart, only idle ones are.
            same = (self.kind[robot], partial.loads[robot])
            if same in tried and (not self.apart or not partial.loads[robot]):
                continue
            tried.add(same)
            partial.put(actor, robot)
            complete = self.go() and complete
            if not complete and self.steps > SEARCH_STEPS:
                break
        partial.put(actor, -1)
        self.left.add(actor)
        return complete

    def _next(self) -> tuple[int, list[int]]:
        partial = self.partial
        rated = []
        for actor in self.left:
            free = list(bits(self.able[actor] & ~taken(partial, actor)))
            self.steps += 1 + len(free)
            rated.append((len(free), -partial.load[actor], actor, free))
        _, _, actor, free = min(rated)
        return actor, sorted(free, key=partial.loads.__getitem__)
