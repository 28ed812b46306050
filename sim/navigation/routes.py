"""Routes for one robot that has the floor to itself."""

from __future__ import annotations

import bisect
import math
from collections.abc import Collection, Sequence
from itertools import accumulate, pairwise

import numpy as np

from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.robots import PoseMRad
from sim.files.world_schema import WorldFile
from sim.navigation.floor import Floor, Floors
from sim.navigation.spots import Spots

XY = tuple[float, float]


class Route:
    """A way along straight pieces. `points_m` are its corners; it ends at a node."""

    def __init__(self, points_m: Sequence[XY], yaw_rad: float, node: int) -> None:
        self.node = node
        self._points, self._yaw = list(points_m), yaw_rad
        steps = (math.dist(a, b) for a, b in pairwise(points_m))
        self._ends = list(accumulate(steps, initial=0.0))

    @property
    def length_m(self) -> float:
        """From start to end."""
        return self._ends[-1]

    def at(self, share: float) -> PoseMRad:
        """Where one is after `share` (0 to 1) of the way."""
        done = share * self.length_m
        k = min(bisect.bisect_right(self._ends, done), len(self._ends) - 1)
        if share >= 1.0 or k == 0:
            return (*self._points[-1], self._yaw)
        (ax, ay), (bx, by) = self._points[k - 1], self._points[k]
        part = (done - self._ends[k - 1]) / max(self._ends[k] - self._ends[k - 1], 1e-9)
        yaw = math.atan2(by - ay, bx - ax)
        return (ax + part * (bx - ax), ay + part * (by - ay), yaw)


class Routes:
    """Routes over the lattice of one world, for robots that do not mind each other."""

    def __init__(self, world: WorldFile) -> None:
        self._spots = Spots(world)
        self._lattice = self._spots.lattice
        self._floors = Floors(self._lattice)

    def close(self, closures: Sequence[Closure]) -> None:
        """From now on routes enter nothing that these close."""
        self._floors = Floors(self._lattice, closures)

    def closed_to(self, model: str) -> tuple[Closure, ...]:
        """What is closed for robots of a model."""
        return self._floors.of(model).closures

    def to_place(
        self, start: PoseMRad, place: str, taken: Collection[int], model: str = ""
    ) -> Route | None:
        """To a waiting spot in `place`, rather none of `taken`; `None`: there is no way for a robot
        of this model."""
        first, floor = self.nearest(start[:2]), self._floors.of(model)
        field = floor.field_from(first)
        spots = [n for n in self._spots.waiting[place] if math.isfinite(field[n])]
        if not spots:
            return None
        best = min(spots, key=lambda n: (n in taken, field[n], n))
        return self._route(start, best, start[2], floor)

    def to_point(
        self, start: PoseMRad, point_m: Sequence[float], reach_m: float, model: str = ""
    ) -> Route | None:
        """To the node nearest to `point_m`, facing it; `None`: there is none within reach."""
        target = (point_m[0], point_m[1])
        gaps = np.linalg.norm(self._lattice.points_m - target, axis=1)
        floor = self._floors.of(model)
        field = floor.field_from(self.nearest(start[:2]))
        for node in np.argsort(gaps, kind="stable").tolist():
            if gaps[node] > reach_m:
                return None
            if math.isfinite(field[node]):
                x, y = self._lattice.points_m[node]
                yaw = math.atan2(target[1] - y, target[0] - x)
                return self._route(start, node, yaw, floor)
        return None

    def nearest(self, point_m: Sequence[float]) -> int:
        """The node next to a point."""
        gaps = self._lattice.points_m - (point_m[0], point_m[1])
        return int(np.argmin((gaps**2).sum(axis=1)))

    def _route(self, start: PoseMRad, goal: int, yaw_rad: float, floor: Floor) -> Route:
        field = floor.field_to(frozenset({goal}), frozenset())
        node = self.nearest(start[:2])
        corners = [(start[0], start[1])]
        while True:
            x, y = (float(v) for v in self._lattice.points_m[node])
            corners.append((x, y))
            if node == goal:
                break
            around = [*floor.neighbours[node], *floor.diagonals[node]]
            node = min(around, key=lambda v: (field[v], v))
        return Route(corners, yaw_rad, goal)
