"""How far points on the floor are from everything solid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.files.solids import Solid, solids
from sim.files.world_schema import WorldFile

Floats = NDArray[np.float64]
Point = tuple[float, float]

SAMPLE_M = 0.025
"""Spacing of the samples along a segment."""

TILE_M = 1.0
"""Side of the squares for each of which it is known which solids may be the nearest one."""
TILES = 8
"""So many squares a side are sorted out together."""
MANY = 100_000
"""More distances than that of points to solids are worked out by squares."""
AT_ONCE = 100_000
"""So many points at a time: the memory that a question takes does not grow with it."""


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
        among = self._height > above_m
        near = self._nearest(points.reshape(-1, 2), among)
        if points.size // 2 * len(near) > MANY and among.all():
            flat = points.reshape(-1, 2)
            parts = [self._by_tiles(flat[k : k + AT_ONCE]) for k in range(0, len(flat), AT_ONCE)]
            return np.concatenate(parts).reshape(points.shape[:-1])
        delta = points[..., None, :] - self._centre[near]  # (…, n, 2)
        cos, sin = self._cos[near], self._sin[near]
        along = np.abs(cos * delta[..., 0] + sin * delta[..., 1]) - self._half[near, 0]
        across = np.abs(cos * delta[..., 1] - sin * delta[..., 0]) - self._half[near, 1]
        distance: Floats = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0)).min(axis=-1)
        inside = ((points >= 0.0) & (points <= self._size)).all(axis=-1)
        return np.where(inside, distance, 0.0)

    def _by_tiles(self, points: Floats) -> Floats:
        """As `at`, of many points `(k, 2)` all over the building."""
        distance = np.zeros(len(points))
        inside = ((points >= 0.0) & (points <= self._size)).all(axis=1)
        points = points[inside]
        firsts, counts, boxes = self._tiles
        cell = np.minimum((points / TILE_M).astype(np.intp), self._tile_counts - 1)
        tile = cell[:, 0] * self._tile_counts[1] + cell[:, 1]
        count = counts[tile]
        starts = np.cumsum(count) - count  # of each point's row of candidates
        row = np.repeat(np.arange(len(points)), count)
        box = boxes[np.arange(len(row)) - np.repeat(starts - firsts[tile], count)]
        if len(row):
            distance[inside] = np.minimum.reduceat(self._to_boxes(points[row], box), starts)
        return distance

    def _to_boxes(self, points: Floats, box: NDArray[np.intp]) -> Floats:
        """Distance of each point `(k, 2)` to the box beside it in `box` `(k,)`, m."""
        delta = points - self._centre[box]
        cos, sin = self._cos[box], self._sin[box]
        along = np.abs(cos * delta[:, 0] + sin * delta[:, 1]) - self._half[box, 0]
        across = np.abs(cos * delta[:, 1] - sin * delta[:, 0]) - self._half[box, 1]
        found: Floats = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
        return found

    @cached_property
    def _tile_counts(self) -> NDArray[np.intp]:
        return np.ceil(self._size / TILE_M).astype(np.intp)  # (2,)

    @cached_property
    def _tiles(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """Of each tile the boxes that may be the nearest to a point in it: where they begin in the
        third array, how many they are, and the boxes of all tiles one after the other."""
        nx, ny = self._tile_counts
        everything = np.arange(len(self._half))
        rows = [everything] * (nx * ny)
        for i in range(0, nx, TILES):
            for j in range(0, ny, TILES):
                block = np.array([(i + TILES / 2) * TILE_M, (j + TILES / 2) * TILE_M])
                [around] = self._may_be_nearest(block[None], TILES * TILE_M, everything)
                cells = [
                    (x, y)
                    for x in range(i, min(i + TILES, nx))
                    for y in range(j, min(j + TILES, ny))
                ]
                centres = (np.array(cells) + 0.5) * TILE_M
                for (x, y), boxes in zip(
                    cells, self._may_be_nearest(centres, TILE_M, around), strict=True
                ):
                    rows[x * ny + y] = boxes
        counts = np.array([len(row) for row in rows], dtype=np.intp)
        return np.cumsum(counts) - counts, counts, np.concatenate(rows)

    def _may_be_nearest(
        self, centres: Floats, side_m: float, among: NDArray[np.intp]
    ) -> list[NDArray[np.intp]]:
        """Of each square around `centres` `(t, 2)` the boxes that may be nearest to a point in it.

        From the centre to any point in the square a distance changes by half a diagonal at most.
        """
        points = np.repeat(centres, len(among), axis=0)
        distance = self._to_boxes(points, np.tile(among, len(centres))).reshape(-1, len(among))
        most = distance.min(axis=1) + side_m * math.sqrt(2.0) + 1e-9
        return [among[row] for row in distance <= most[:, None]]

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
