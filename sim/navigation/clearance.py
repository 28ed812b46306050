"""How far points on the floor are from everything solid."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.files.solids import Solid, solids
from sim.files.world_schema import WorldFile

Floats = NDArray[np.float64]
Point = tuple[float, float]

SAMPLE_M = 0.025
"""Spacing of the samples along a segment."""


class Clearance:
    """Exact distances to the upright boxes that walls and furniture are.

    A grid with a distance transform is off by up to half a cell's diagonal; with some dozen boxes
    the exact answer costs no more, and a stance in front of a table needs the centimetres.
    """

    def __init__(self, world: WorldFile, boxes: Sequence[Solid] | None = None) -> None:
        """`boxes` are those that count, if not all that stands on the floor."""
        boxes = solids(world) if boxes is None else boxes
        self._size = np.asarray(world.size_m)
        self._centre = np.array([s.center_m for s in boxes])  # (n, 2) m
        self._half = np.array([s.half_m for s in boxes])  # (n, 2) m
        yaw = np.array([s.yaw_rad for s in boxes])
        self._cos, self._sin = np.cos(yaw), np.sin(yaw)  # (n,)
        self._radius = np.hypot(self._half[:, 0], self._half[:, 1])  # (n,) m
        self._height = np.array([s.height_m for s in boxes])

    def at(self, points_m: ArrayLike, above_m: float = 0.0) -> Floats:
        """Distance of each point `(…, 2)` to the nearest solid that rises above `above_m`, m.

        0 inside a solid and outside the building.
        """
        points = np.asarray(points_m, dtype=np.float64)
        near = self._nearest(points.reshape(-1, 2), self._height > above_m)
        delta = points[..., None, :] - self._centre[near]  # (…, n, 2)
        cos, sin = self._cos[near], self._sin[near]
        along = np.abs(cos * delta[..., 0] + sin * delta[..., 1]) - self._half[near, 0]
        across = np.abs(cos * delta[..., 1] - sin * delta[..., 0]) - self._half[near, 1]
        distance: Floats = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0)).min(axis=-1)
        inside = ((points >= 0.0) & (points <= self._size)).all(axis=-1)
        return np.where(inside, distance, 0.0)

    def _nearest(self, points: Floats, among: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Those `among` the solids that may be the nearest one to one of the points `(k, 2)`.

        No solid is farther off than its centre, nor nearer than its centre less its radius.
        """
        if not len(points):
            return np.flatnonzero(among)
        low, high = points.min(axis=0), points.max(axis=0)
        least = np.maximum(np.maximum(low - self._centre, self._centre - high), 0.0)
        most = np.maximum(high - self._centre, self._centre - low)
        nearer = np.hypot(least[:, 0], least[:, 1]) - self._radius
        farther = np.hypot(most[:, 0], most[:, 1])
        return np.flatnonzero(among & (nearer <= farther[among].min()))

    def along(self, start_m: ArrayLike, ends_m: ArrayLike, above_m: float = 0.0) -> Floats:
        """Least distance to a solid on the straight lines from `start_m` to each of `ends_m`, m.

        `start_m` is `(2,)` or `(k, 2)`, `ends_m` `(k, 2)`; the result is `(k,)`.
        """
        ends = np.atleast_2d(np.asarray(ends_m, dtype=np.float64))
        starts = np.broadcast_to(np.asarray(start_m, dtype=np.float64), ends.shape)
        if not len(ends):
            return np.zeros(0)
        longest = float(np.linalg.norm(ends - starts, axis=1).max())
        share = np.linspace(0.0, 1.0, max(2, int(np.ceil(longest / SAMPLE_M)) + 1))
        points = starts[:, None] + share[None, :, None] * (ends - starts)[:, None]  # (k, s, 2)
        least: Floats = self.at(points, above_m).min(axis=1)
        return least


def segment_gap(one_m: tuple[Point, Point], other_m: tuple[Point, Point]) -> float:
    """Least distance between two segments, m: plain numbers, as it is asked a thousand times."""
    if _cross(one_m, other_m):
        return 0.0
    return min(
        *(_gap_to(end, other_m) for end in one_m),
        *(_gap_to(end, one_m) for end in other_m),
    )


def _gap_to(point_m: Point, segment_m: tuple[Point, Point]) -> float:
    (x, y), ((ax, ay), (bx, by)) = point_m, segment_m
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    share = 0.0 if length2 == 0.0 else ((x - ax) * dx + (y - ay) * dy) / length2
    share = min(1.0, max(0.0, share))
    return math.hypot(x - ax - share * dx, y - ay - share * dy)


def _cross(one_m: tuple[Point, Point], other_m: tuple[Point, Point]) -> bool:
    """Whether the ends of each lie on different sides of the other."""
    return all(
        _side(*line, ends[0]) * _side(*line, ends[1]) < 0.0
        for line, ends in ((one_m, other_m), (other_m, one_m))
    )


def _side(start_m: Point, end_m: Point, point_m: Point) -> float:
    (ax, ay), (bx, by), (x, y) = start_m, end_m, point_m
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)
