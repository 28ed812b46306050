"""What goes wrong in a mission after a while, by simulated time."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from enum import Enum

from benchmarks.planning.missions import MissionEntry

UNREGISTERED_AFTER_S = 60.0
"""So long after a robot has died a person says that it will not come back."""


class Mishap(str, Enum):
    """A robot's worker ends for good; a person unregisters that robot; a thing is put elsewhere."""

    DIES = "dies"
    UNREGISTERED = "unregistered"
    MOVED = "moved"


class Mishaps:
    """Those of one mission, in the order of time."""

    def __init__(self, entry: MissionEntry) -> None:
        self._ahead = [
            *((at_s, Mishap.DIES, robot) for robot, at_s in entry.dies.items()),
            *(
                (at_s + UNREGISTERED_AFTER_S, Mishap.UNREGISTERED, robot)
                for robot, at_s in entry.dies.items()
            ),
            *((move.at_s, Mishap.MOVED, thing) for thing, move in entry.moves.items()),
        ]
        heapq.heapify(self._ahead)

    @property
    def next_s(self) -> float | None:
        """When the next one happens."""
        return self._ahead[0][0] if self._ahead else None

    def due(self, time_s: float) -> Iterator[tuple[Mishap, str]]:
        """Those that happen by now, and never again: what happens to whom."""
        while self._ahead and self._ahead[0][0] <= time_s:
            _, what, name = heapq.heappop(self._ahead)
            yield what, name
