"""Sharing actors of unequal load, and actors that must be apart: greedy, local, then exact search.

Everything here counts steps and not seconds, so that the same problem has the same answer.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Collection, Sequence

from fleet.allocators.balancing.apart import neighbours
from fleet.allocators.balancing.bits import bits

LOCAL_STEPS = 400_000
"""Pairs of actor and robot, or actor and actor, that are tried at most in local search."""
SEARCH_STEPS = 400_000
"""Choices of a robot for an actor that branch and bound weighs at most: about half a second."""
SEARCH_ACTORS = 60
"""With more actors, branch and bound has no hope of proving anything in so few steps."""
FEASIBLE_ACTORS = 400
"""With more actors it is not even used to find any sharing: it is as deep as there are actors."""


class Sharing:
    """A robot for every actor, with the loads that follow; none apart are together."""

    def __init__(self, load: Sequence[int], robots: int, near: Sequence[set[int]]) -> None:
        self.load = load
        self.near = near
        self.robot = [-1] * len(load)
        self.loads = [0] * robots
        self.of: list[set[int]] = [set() for _ in range(robots)]

    @classmethod
    def mended(
        cls,
        load: Sequence[int],
        robots: int,
        apart: Collection[tuple[int, int]],
        robot: Sequence[int],
    ) -> Sharing:
        """From a robot for every actor in which some that are apart may be together.

        Those are left out, for `improve` to place.
        """
        made = cls(load, robots, neighbours(apart, len(load)))
        for actor, its in enumerate(robot):
            if made.fits(actor, its):
                made.put(actor, its)
        return made

    def put(self, actor: int, robot: int) -> None:
        """Give an actor to a robot, away from the one that it has."""
        before = self.robot[actor]
        if before >= 0:
            self.loads[before] -= self.load[actor]
            self.of[before].discard(actor)
        self.robot[actor] = robot
        if robot >= 0:
            self.loads[robot] += self.load[actor]
            self.of[robot].add(actor)

    def fits(self, actor: int, robot: int, without: int = -1) -> bool:
        """Whether no other actor of the robot must be apart from this one."""
        return not any(self.robot[other] == robot for other in self.near[actor] if other != without)

    def sorted_loads(self) -> list[int]:
        """The loads, the greatest first."""
        return sorted(self.loads, reverse=True)


def longest_first(
    able: Sequence[int], load: Sequence[int], robots: int, apart: Collection[tuple[int, int]]
) -> Sharing | None:
    """Each actor to the able robot with the least load; the longest first, or the most bound.

    `None` if one has no robot left that it may be.
    """
    near = neighbours(apart, len(load))
    made = Sharing(load, robots, near)
    order = sorted(range(len(load)), key=lambda a: (-len(near[a]), -load[a], able[a].bit_count()))
    at = {0: (1 << robots) - 1}
    levels = [0]
    for actor in order:
        free = able[actor] & ~_taken(made, actor)
        level = next((level for level in levels if free & at[level]), -1)
        if level < 0:
            return None
        bit = (found := free & at[level]) & -found
        made.put(actor, bit.bit_length() - 1)
        at[level] ^= bit
        if not at[level]:
            del at[level]
            levels.remove(level)
        if (higher := level + load[actor]) not in at:
            at[higher] = 0
            insort(levels, higher)
        at[higher] |= bit
    return made


def _taken(sharing: Sharing, actor: int) -> int:
    """The robots that the actor must not be, since another one is."""
    mask = 0
    for other in sharing.near[actor]:
        if sharing.robot[other] >= 0:
            mask |= 1 << sharing.robot[other]
    return mask


def improve(sharing: Sharing, able: Sequence[int], relaxed: Sequence[int]) -> Sharing | None:
    """Hand over and swap actors while that makes the loads lexicographically less.

    Of two robots' loads, with their sum kept, the lower maximum is the better. Stops early at the
    loads `relaxed`, below which there are none. `None` if an actor that has no robot finds none.
    """
    for actor in [a for a, robot in enumerate(sharing.robot) if robot < 0]:
        if not _placed(sharing, actor, able):
            return None
    left = LOCAL_STEPS
    moved = True
    while moved and left > 0 and sharing.sorted_loads() != relaxed:
        moved = False
        for robot in sorted(range(len(sharing.loads)), key=lambda r: -sharing.loads[r]):
            while left > 0:
                done, steps = _relieve(sharing, robot, able)
                left -= steps
                if not done:
                    break
                moved = True
    return sharing


def _placed(sharing: Sharing, actor: int, able: Sequence[int]) -> bool:
    """Find a robot for an actor without one, if need be by sending one other actor elsewhere."""
    ranked = sorted(bits(able[actor]), key=sharing.loads.__getitem__)
    for robot in ranked:
        if sharing.fits(actor, robot):
            sharing.put(actor, robot)
            return True
    for robot in ranked:
        blocking = [other for other in sharing.near[actor] if sharing.robot[other] == robot]
        if len(blocking) != 1:
            continue
        for elsewhere in sorted(bits(able[blocking[0]]), key=sharing.loads.__getitem__):
            if elsewhere != robot and sharing.fits(blocking[0], elsewhere):
                sharing.put(blocking[0], elsewhere)
                sharing.put(actor, robot)
                return True
    return False


def _relieve(sharing: Sharing, robot: int, able: Sequence[int]) -> tuple[bool, int]:
    """Take load off a robot by the first change that evens out; whether, and the steps it took."""
    loads, load = sharing.loads, sharing.load
    steps = 0
    mine = sorted(sharing.of[robot], key=load.__getitem__, reverse=True)
    others = sorted(
        (r for r in range(len(loads)) if loads[r] < loads[robot] - 1), key=loads.__getitem__
    )
    for other in others:
        for actor in mine:
            steps += 1
            if not able[actor] >> other & 1:
                continue
            if loads[other] + load[actor] < loads[robot] and sharing.fits(actor, other):
                sharing.put(actor, other)
                return True, steps
            gap = loads[robot] - loads[other]
            for back in sharing.of[other]:
                steps += 1
                if (
                    0 < load[actor] - load[back] < gap
                    and able[back] >> robot & 1
                    and sharing.fits(actor, other, back)
                    and sharing.fits(back, robot, actor)
                ):
                    sharing.put(actor, other)
                    sharing.put(back, robot)
                    return True, steps
    return False, steps


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
            free = list(bits(self.able[actor] & ~_taken(partial, actor)))
            self.steps += 1 + len(free)
            rated.append((len(free), -partial.load[actor], actor, free))
        _, _, actor, free = min(rated)
        return actor, sorted(free, key=partial.loads.__getitem__)
