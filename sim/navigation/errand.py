"""Where one robot shall go."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from keyexpr_schema.payloads.robots import PoseMRad
from sim.navigation.spots import Dock
from sim.navigation.traveller import Traveller

PATIENCE_S, QUEUE_PATIENCE_S, STUCK_S = 60.0, 300.0, 30.0
"""Simulated time after which a robot that cannot get on gives up; the same while somebody does, and
when nobody does any more: work at a table takes that long."""

SAME_STANCE_M = 0.01
"""Stances nearer to each other are one: what is in reach from the one is from the other, too."""

MOST_JUDGED = 24
"""So many stances are looked at for one that suits: each takes an arm some milliseconds."""


@dataclass
class Errand:
    """To a place, or to one of some stances; the best that `fits` if there is one. `what` is for
    people; `since_s` is when it was sent, `moved_s` and
    `moved_at` are when and where it last got on."""

    what: str
    since_s: float
    place: str | None = None
    docks: tuple[Dock, ...] = ()
    fits: Callable[[PoseMRad], bool] | None = None
    moved_s: float | None = None
    moved_at: tuple[float, float] = (0.0, 0.0)
    _judged: dict[Dock, bool] = field(default_factory=dict)

    def closed_to(self, robot: Traveller, waiting: Mapping[str, Sequence[int]]) -> str | None:
        """What is closed, if that keeps a robot from all of where it may go; `waiting` are the
        nodes in each place."""
        floor = robot.floor
        if not floor.closures or any(self.at(robot)):
            return None
        ends = list(waiting[self.place]) if self.place is not None else []
        ends += [dock.node for dock in self.docks if not floor.is_closed_at(dock.point_m)]
        around = floor.field_from(robot.frontier)
        if any(math.isfinite(around[node]) for node in ends):
            return None
        return "; ".join(map(str, floor.closures))

    def at(self, robot: Traveller) -> Iterator[Dock]:
        """Those of the stances at which a robot stands already."""
        if robot.parked is not None and not robot.leaving:
            here = robot.parked.point_m
            yield from (d for d in self.docks if math.dist(d.point_m, here) < SAME_STANCE_M)

    def suits(self, dock: Dock) -> bool:
        """Whether a stance fits, as far as that is looked at."""
        if self.fits is None:
            return True
        if dock not in self._judged:
            if len(self._judged) >= MOST_JUDGED:
                return False
            self._judged[dock] = self.fits((*dock.point_m, dock.yaw_rad))
        return self._judged[dock]

    def suiting_first(self, docks: Sequence[Dock]) -> Iterator[Dock]:
        """The stances that suit, in order; where none does, all: one can come up to what one cannot
        get at."""
        yield from (dock for dock in docks if self.suits(dock))
        if self.fits is not None and not any(self._judged.values()):
            yield from docks


def patience_s(got_on_s: float, time_s: float) -> float:
    """Longer while some get on, the last one at `got_on_s`: then they are a queue, and nobody is
    stuck."""
    return PATIENCE_S if time_s - got_on_s > STUCK_S else QUEUE_PATIENCE_S
