"""Sharing actors of unequal load, and actors that must be apart: greedy, then by local changes.

Everything here counts steps and not seconds, so that the same problem has the same answer.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Collection, Sequence

from fleet.allocators.load_balancing.apart import neighbours
from fleet.allocators.load_balancing.bits import bits

LOCAL_STEPS = 400_000
"""Pairs of actor and robot, or actor and actor, that are tried at most in local search."""


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
        free = able[actor] & ~taken(made, actor)
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


def taken(sharing: Sharing, actor: int) -> int:
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
