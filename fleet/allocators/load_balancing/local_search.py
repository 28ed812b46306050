"""Actors of unequal load, and actors that must be apart: longest first, then local search.

Everything here counts steps and not seconds, so that the same problem has the same answer.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Sequence

from fleet.allocators.load_balancing.problem import LoadBalancingProblem
from fleet.allocators.load_balancing.robot_sets import bits

LOCAL_STEPS = 400_000
"""Pairs of actor and robot, or actor and actor, that are tried at most in local search."""


class PartialAssignment:
    """A robot for every actor, or -1, with the loads that follow; none apart are together."""

    def __init__(self, problem: LoadBalancingProblem, robot: Sequence[int] = ()) -> None:
        """Of actors in `robot` that are together and must be apart, the later stay without one."""
        self.problem = problem
        self.robot = [-1] * len(problem.load)
        self.loads = [0] * problem.robots
        self.actors: list[set[int]] = [set() for _ in range(problem.robots)]
        for actor, chosen in enumerate(robot):
            if self.fits(actor, chosen):
                self.assign(actor, chosen)

    def assign(self, actor: int, robot: int) -> None:
        """Give an actor to a robot, away from the one that it has; -1 for none."""
        load, before = self.problem.load[actor], self.robot[actor]
        if before >= 0:
            self.loads[before] -= load
            self.actors[before].discard(actor)
        self.robot[actor] = robot
        if robot >= 0:
            self.loads[robot] += load
            self.actors[robot].add(actor)

    def fits(self, actor: int, robot: int, without: int = -1) -> bool:
        """Whether no other actor of the robot must be apart from this one."""
        conflicts = self.problem.conflicts[actor]
        return not any(self.robot[other] == robot for other in conflicts if other != without)

    def free(self, actor: int) -> int:
        """The robots that the actor can be and none it must be apart from is, as a set."""
        mask = 0
        for other in self.problem.conflicts[actor]:
            if self.robot[other] >= 0:
                mask |= 1 << self.robot[other]
        return self.problem.able[actor] & ~mask

    def sorted_loads(self) -> list[int]:
        """The loads, the greatest first."""
        return sorted(self.loads, reverse=True)


def longest_first(problem: LoadBalancingProblem) -> PartialAssignment | None:
    """Each actor to the able robot with the least load; those with most conflicts first, then the
    longest. `None` if one has no robot left that it may be."""
    able, load, conflicts = problem.able, problem.load, problem.conflicts
    made = PartialAssignment(problem)
    order = sorted(
        range(len(load)), key=lambda a: (-len(conflicts[a]), -load[a], able[a].bit_count())
    )
    at = {0: (1 << problem.robots) - 1}
    levels = [0]
    for actor in order:
        free = made.free(actor)
        level = next((level for level in levels if free & at[level]), -1)
        if level < 0:
            return None
        bit = (found := free & at[level]) & -found
        made.assign(actor, bit.bit_length() - 1)
        at[level] ^= bit
        if not at[level]:
            del at[level]
            levels.remove(level)
        if (higher := level + load[actor]) not in at:
            at[higher] = 0
            insort(levels, higher)
        at[higher] |= bit
    return made


def improve(made: PartialAssignment, relaxed: Sequence[int]) -> PartialAssignment | None:
    """Place who has no robot, then move and swap actors while that lowers the sorted loads.

    Of two robots' loads, with their sum kept, the lower maximum is the better. Stops early at the
    loads `relaxed`, below which there are none. `None` if an actor that has no robot finds none.
    """
    for actor in [a for a, robot in enumerate(made.robot) if robot < 0]:
        if not _place(made, actor):
            return None
    left = LOCAL_STEPS
    moved = True
    while moved and left > 0 and made.sorted_loads() != relaxed:
        moved = False
        for robot in sorted(range(len(made.loads)), key=lambda r: -made.loads[r]):
            while left > 0:
                done, steps = _relieve(made, robot)
                left -= steps
                if not done:
                    break
                moved = True
    return made


def _place(made: PartialAssignment, actor: int) -> bool:
    """Find a robot for an actor without one, if need be by sending one other actor elsewhere."""

    def ranked(actor: int) -> list[int]:
        return sorted(bits(made.problem.able[actor]), key=made.loads.__getitem__)

    robots = ranked(actor)
    for robot in robots:
        if made.fits(actor, robot):
            made.assign(actor, robot)
            return True
    for robot in robots:
        blocking = [o for o in made.problem.conflicts[actor] if made.robot[o] == robot]
        if len(blocking) != 1:
            continue
        for elsewhere in ranked(blocking[0]):
            if elsewhere != robot and made.fits(blocking[0], elsewhere):
                made.assign(blocking[0], elsewhere)
                made.assign(actor, robot)
                return True
    return False


def _relieve(made: PartialAssignment, robot: int) -> tuple[bool, int]:
    """Take load off a robot by the first change that evens out; whether, and the steps it took."""
    loads, load, able = made.loads, made.problem.load, made.problem.able
    steps = 0
    heaviest_first = sorted(made.actors[robot], key=load.__getitem__, reverse=True)
    others = sorted(
        (r for r in range(len(loads)) if loads[r] < loads[robot] - 1), key=loads.__getitem__
    )
    for other in others:
        for actor in heaviest_first:
            steps += 1
            if not able[actor] >> other & 1:
                continue
            if loads[other] + load[actor] < loads[robot] and made.fits(actor, other):
                made.assign(actor, other)
                return True, steps
            gap = loads[robot] - loads[other]
            for back in made.actors[other]:
                steps += 1
                if (
                    0 < load[actor] - load[back] < gap
                    and able[back] >> robot & 1
                    and made.fits(actor, other, back)
                    and made.fits(back, robot, actor)
                ):
                    made.assign(actor, other)
                    made.assign(back, robot)
                    return True, steps
    return False, steps
