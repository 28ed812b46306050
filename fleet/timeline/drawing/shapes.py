"""Solids of bodies as Rerun archetypes, and how much room they take."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rerun as rr

from fleet.timeline.drawing.sink import Sink
from keyexpr_schema.payloads.motions import PointM
from keyexpr_schema.payloads.simulation import Shape, ShapeKind


class Bounds:
    """The rectangle of floor [m] that the fixed things cover."""

    def __init__(self) -> None:
        self._low: tuple[float, float] | None = None
        self._high: tuple[float, float] | None = None

    def cover(self, x_m: float, y_m: float) -> None:
        """Grow to hold this point."""
        low, high = self._low or (x_m, y_m), self._high or (x_m, y_m)
        self._low = (min(low[0], x_m), min(low[1], y_m))
        self._high = (max(high[0], x_m), max(high[1], y_m))

    def add(self, point_m: PointM, shapes: Sequence[Shape]) -> None:
        """Grow to hold the centres of these shapes of a body (its rotation is left out)."""
        for shape in shapes:
            self.cover(point_m[0] + shape.point_m[0], point_m[1] + shape.point_m[1])

    def rectangle(self) -> tuple[float, float, float, float] | None:
        """`(x_min, y_min, x_max, y_max)`; `None` if nothing is known."""
        if self._low is None or self._high is None:
            return None
        return (*self._low, *self._high)


def log_shapes(sink: Sink, path: str, shapes: Sequence[Shape]) -> None:
    """Log the solids of a body below `path`, one entity a kind, in the body's frame."""
    solid = rr.components.FillMode.Solid
    for kind in ShapeKind:
        some = [shape for shape in shapes if shape.kind is kind]
        if not some:
            continue
        centres = [shape.point_m for shape in some]
        turns = [[x, y, z, w] for w, x, y, z in (shape.quaternion_wxyz for shape in some)]
        colours = [[round(255 * min(1.0, max(0.0, part))) for part in s.rgba] for s in some]
        sizes = [shape.size_m for shape in some]
        look: dict[str, Any] = {"quaternions": turns, "colors": colours, "fill_mode": solid}
        radii, lengths = [size[0] for size in sizes], [2 * size[1] for size in sizes]
        what: object
        if kind is ShapeKind.BOX:
            what = rr.Boxes3D(half_sizes=sizes, centers=centres, **look)
        elif kind is ShapeKind.CYLINDER:
            what = rr.Cylinders3D(lengths=lengths, radii=radii, centers=centres, **look)
        elif kind is ShapeKind.SPHERE:
            what = rr.Ellipsoids3D(
                half_sizes=[(radius,) * 3 for radius in radii], centers=centres, **look
            )
        else:
            starts = [_cap(shape) for shape in some]
            what = rr.Capsules3D(lengths=lengths, radii=radii, translations=starts, **look)
        sink.fix(f"{path}/{kind.value}", what)


def _cap(shape: Shape) -> PointM:
    """Where Rerun wants a capsule to start: the end of its axis, where ours has its middle."""
    w, x, y, z = shape.quaternion_wxyz
    half = shape.size_m[1]
    axis = (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y))
    px, py, pz = shape.point_m
    return (px - half * axis[0], py - half * axis[1], pz - half * axis[2])
