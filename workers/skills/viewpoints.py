"""Where to look from, to see all of a place. Pure geometry; metres, world frame.

Only the camera's range counts here, not what stands in the way: so "all of it was in range" is
good enough to say that one does not know where a thing is, never that it is not there.
"""

from __future__ import annotations

from math import dist, sqrt

from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Place

PointM2 = tuple[float, float]

STEP_M = 0.25
MOST_CELLS = 400
"""A large place gets a coarser grid, so that choosing a viewpoint takes milliseconds."""
BORDER_M = 0.15
"""What lies closer to a place's border than this lies in a wall or in a doorway."""
CLEAR_M = 0.6
"""Viewpoints keep this far from a place's border, where walls are."""
RANGE_MARGIN = 0.9
"""Part of the camera's range that is counted on: an object's far side is a little farther off."""
DEFAULT_RANGE_M = 3.0
"""For a robot whose spec does not say how far it sees (capability `see`)."""


class Viewing:
    """Which part of a place has been in the camera's range, and where to look from next."""

    def __init__(self, place: Place, see_m: float) -> None:
        self._see_m = see_m * RANGE_MARGIN
        self._cells = cells(place, BORDER_M)
        self._unseen = set(self._cells)
        self._stands = list(cells(place, CLEAR_M)) or list(self._cells)
        self._looked_from: list[PointM2] = []

    @classmethod
    def of(cls, place: Place, spec: RobotSpec) -> Viewing:
        """For the camera that a robot's spec declares."""
        return cls(place, spec.capabilities.get("see", DEFAULT_RANGE_M))

    @property
    def complete(self) -> bool:
        """Whether every part of the place has been in range."""
        return not self._unseen

    @property
    def looks(self) -> int:
        """How many looks there were."""
        return len(self._looked_from)

    def looked_from(self, x_m: float, y_m: float) -> None:
        """Note a look around from there."""
        self._looked_from.append((x_m, y_m))
        self._unseen = {c for c in self._unseen if dist(c, (x_m, y_m)) > self._see_m}

    def next(self) -> PointM2 | None:
        """The spot that brings most of what is left into range; `None` if there is no spot left.

        Among equals, the one farthest from where one has looked already: a different angle.
        """
        if not self._stands:
            return None
        return max(self._stands, key=self._worth)

    def unreachable(self, spot: PointM2) -> None:
        """Note that one cannot get to a spot: it and those about it are not proposed again."""
        self._stands = [s for s in self._stands if dist(s, spot) > CLEAR_M]

    def _worth(self, spot: PointM2) -> tuple[int, float]:
        gained = sum(dist(c, spot) <= self._see_m for c in self._unseen)
        away = min((dist(spot, seen) for seen in self._looked_from), default=0.0)
        return gained, round(away, 6)


def cells(place: Place, inset_m: float) -> tuple[PointM2, ...]:
    """Points on a grid in the place's rectangles, `inset_m` from each one's border.

    `STEP_M` apart, or more where the place is large.
    """
    area_m2 = sum((c - a) * (d - b) for a, b, c, d in place.region_m)
    step_m = max(STEP_M, sqrt(area_m2 / MOST_CELLS))
    points: dict[PointM2, None] = {}
    for x_min, y_min, x_max, y_max in place.region_m:
        columns = _line(x_min + inset_m, x_max - inset_m, step_m)
        rows = _line(y_min + inset_m, y_max - inset_m, step_m)
        points.update(dict.fromkeys((x, y) for x in columns for y in rows))
    return tuple(points)


def _line(low_m: float, high_m: float, step_m: float) -> tuple[float, ...]:
    if high_m < low_m:
        return ()
    count = max(1, round((high_m - low_m) / step_m))
    return tuple(round(low_m + (high_m - low_m) * i / count, 6) for i in range(count + 1))
