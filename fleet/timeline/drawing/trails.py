"""Trails: the way a robot or an object came, as a line with few corners."""

from __future__ import annotations

from math import dist

import rerun as rr

from fleet.timeline.drawing.palette import Rgba
from fleet.timeline.drawing.sink import Sink
from keyexpr_schema.payloads.motions import PointM

STEP_M = 0.15
"""A trail grows in steps of this length."""

STRAIGHT_M = 0.02
"""A corner that stands out less than this from the line past it is left out."""

LIFT_M = 0.03
"""Trails are drawn this far above where the body is, or the floor would hide them."""

CORNERS = 200
"""The oldest corners go when there are more: a row of a trail never exceeds 2.4 kB."""


class Trail:
    """One line that grows behind a body."""

    def __init__(self, path: str, colour: Rgba, radius_m: float) -> None:
        self._path = path
        self._colour = colour
        self._radius_m = radius_m
        self._points: list[PointM] = []

    def become(self, colour: Rgba, radius_m: float) -> None:
        """Draw on in another colour and thickness: what it is the trail of became known."""
        self._colour, self._radius_m = colour, radius_m

    def visit(self, sink: Sink, point_m: PointM, sim_s: float, wall_s: float) -> None:
        """The body is here; logs the trail when it has grown."""
        point_m = (point_m[0], point_m[1], point_m[2] + LIFT_M)
        points = self._points
        if not points:
            points.append(point_m)
            return
        if dist(points[-1], point_m) < STEP_M:
            return
        if len(points) >= 2 and _off_line(points[-2], points[-1], point_m) < STRAIGHT_M:
            points[-1] = point_m
        else:
            points.append(point_m)
        del points[:-CORNERS]
        sink.row(
            self._path,
            rr.LineStrips3D,
            sim_s,
            wall_s,
            strips=tuple(points),
            colors=self._colour,
            radii=self._radius_m,
        )


def _off_line(a: PointM, b: PointM, c: PointM) -> float:
    """Distance [m] of `b` from the segment `a`-`c`; a way back along itself counts as a corner."""
    ac = tuple(q - p for p, q in zip(a, c, strict=True))
    ab = tuple(q - p for p, q in zip(a, b, strict=True))
    length2 = sum(p * p for p in ac)
    if length2 == 0.0:
        return dist(a, b)
    along = sum(p * q for p, q in zip(ab, ac, strict=True)) / length2
    if along > 1.0 or along < 0.0:
        return float("inf")
    return dist(ab, tuple(along * p for p in ac))
