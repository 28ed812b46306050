"""Who may set out: robots wait in their rooms until the ways have room for them.

A corridor carries most when it is not full, and one that waits in front of a door is in the way of
all others. So whoever would drive through an area that it neither is in nor wants to get to, waits
where it is for a place there, and comes up to the door only then; the longest waiting first, but
past those whose own way is full.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from sim.navigation.gates import Areas
from sim.navigation.traveller import Traveller

SAME_GOAL = 5
"""Robots on their way through an area to the same area beyond: a door takes one in four seconds."""

LEAVING = 3
"""Robots of one area that come up to its door, or queue there, to drive through the next."""


class Admission:
    """Places in areas that robots drive through; a robot keeps its place for all of its errand."""

    def __init__(self, areas: Areas) -> None:
        self._areas = areas
        self._places: dict[str, tuple[float, int]] = {}
        """By robot, since when it has its errand, and the area that it may drive through."""
        self._next: dict[tuple[int, int], int | None] = {}
        self.held: frozenset[str] = frozenset()
        """The robots that have to wait where they are."""

    def forget_ways(self) -> None:
        """Robots have other floors now."""
        self._next.clear()

    def has_place(self, robot: str, area: int) -> bool:
        """Whether a robot may drive through an area."""
        return robot in self._places and self._places[robot][1] == area

    def decide(self, robots: Iterable[Traveller]) -> None:
        """Say anew who is `held`."""
        through: Counter[int] = Counter()
        bound: Counter[tuple[int, int | None]] = Counter()
        leaving: Counter[tuple[int | None, int]] = Counter()
        places: dict[str, tuple[float, int]] = {}
        asking: list[Traveller] = []

        def admit(robot: Traveller, area: int) -> None:
            here, end = self._areas.of(robot.frontier), self._areas.of(robot.goal)
            places[robot.name] = robot.since_s, area
            through[area] += 1
            bound[area, end] += 1
            if here != area:
                leaving[here, area] += 1

        for robot in robots:
            if robot.goal is None:
                continue
            since_s, area = self._places.get(robot.name, (None, -1))
            here, end = self._areas.of(robot.frontier), self._areas.of(robot.goal)
            if here is not None and here == end:
                continue  # it has arrived in the area
            if since_s == robot.since_s:
                admit(robot, area)
            elif here is not None and not robot.static:
                asking.append(robot)
        held = set()
        for robot in sorted(asking, key=lambda robot: (robot.since_s, robot.name)):
            here, end = self._areas.of(robot.frontier), self._areas.of(robot.goal)
            following = self._after(robot)
            if following is None or following == end:
                continue
            if (
                through[following] < self._areas.most[following]
                and bound[following, end] < SAME_GOAL
                and leaving[here, following] < LEAVING
            ):
                admit(robot, following)
            else:
                held.add(robot.name)
        self._places, self.held = places, frozenset(held)

    def _after(self, robot: Traveller) -> int | None:
        """The area that a robot comes to when it leaves the one where it is."""
        here, goal, node = self._areas.of(robot.frontier), robot.goal, robot.frontier
        assert here is not None and goal is not None
        if (here, goal) not in self._next:
            field = robot.floor.field_to(frozenset({goal}), frozenset())
            area: int | None = here
            while area in (here, None):
                best = min(robot.floor.neighbours[node], key=lambda v: (field[v], v), default=node)
                if not field[best] < field[node]:
                    break
                node, area = best, self._areas.of(best)
            self._next[here, goal] = None if area == here else area
        return self._next[here, goal]
