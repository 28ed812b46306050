"""The lattice as robots of one kind may drive on it, with parts of it closed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from keyexpr_schema.payloads.closures import Closure, Rectangle, shut
from sim.files.world_schema import LARGEST_RADIUS_M
from sim.navigation.clearance import Floats
from sim.navigation.distance_field import DistanceField, Step
from sim.navigation.lanes import Pair, lane_costs, with_lanes
from sim.navigation.lattice import Lattice

SAMPLE_M = 0.04
"""Spacing of the samples along a step; nothing that is closed is thinner than a wall, 5 cm."""


class Floor:
    """Where robots may drive: nobody enters what is closed, and who is in there may leave.

    `neighbours` and `diagonals` are those of the lattice that may be driven to. `closures` are what
    closes it. With `lanes`, rows and columns of the lattice have a direction (see `lanes.py`).
    """

    def __init__(
        self, lattice: Lattice, closures: Sequence[Closure] = (), lanes: bool = False
    ) -> None:
        self.closures = tuple(closures)
        self._regions = tuple(box for closure in closures for box in closure.region_m)
        self._shut = nodes_in(lattice, self._regions)
        self._cut = _steps_through(lattice, self._regions)
        self.neighbours, self.diagonals = lattice.neighbours, lattice.diagonals
        self._ahead = self._back = lattice.steps
        if self._regions:
            nodes = range(len(lattice))
            self.neighbours = [[v for v in lattice.neighbours[u] if self._may(u, v)] for u in nodes]
            self.diagonals = [
                {v: c for v, c in lattice.diagonals[u].items() if self._may(u, v, c)} for u in nodes
            ]
            self._ahead = [
                tuple(step for step in lattice.steps[u] if self._may(u, step[0], step[2]))
                for u in nodes
            ]
            self._back = [
                tuple(step for step in lattice.steps[v] if self._may(step[0], v, step[2]))
                for v in nodes
            ]
        if lanes:
            costs = lane_costs(lattice)
            self._ahead = [
                tuple((v, costs[u, v], corners) for v, _, corners in steps)
                for u, steps in enumerate(self._ahead)
            ]
            self._back = [
                tuple((u, costs[u, v], corners) for u, _, corners in steps)
                for v, steps in enumerate(self._back)
            ]
        self.lanes = lanes
        self.costs = [{v: cost for v, cost, _ in steps} for steps in self._ahead]
        """Of each node, what a step to another costs, m."""
        self._field = lru_cache(maxsize=512)(self._new)

    def field_to(self, goals: frozenset[int], blocked: frozenset[int]) -> DistanceField:
        """Driven distance from every node to the nearest of `goals`; `blocked` are not entered."""
        return self._field(False, goals, blocked)

    def field_from(self, node: int, blocked: frozenset[int] = frozenset()) -> DistanceField:
        """Driven distance to every node from this one."""
        return self._field(True, frozenset({node}), blocked)

    def new_field_to(self, goals: frozenset[int], blocked: frozenset[int]) -> DistanceField:
        """As `field_to`, of which nobody else has the same."""
        return self._new(False, goals, blocked)

    def is_closed_at(self, point_m: tuple[float, float]) -> bool:
        """Whether a robot that stands there would be in a closed part."""
        return bool(self._regions) and bool(_within(np.array([point_m]), self._regions)[0])

    def _new(self, ahead: bool, ends: frozenset[int], blocked: frozenset[int]) -> DistanceField:
        steps: Sequence[Sequence[Step]] = self._ahead if ahead else self._back
        return DistanceField(steps, ends, blocked)

    def _may(self, start: int, end: int, corners: tuple[int, ...] = ()) -> bool:
        if start in self._shut:
            return True
        if end in self._shut or (start, end) in self._cut:
            return False
        return self._shut.isdisjoint(corners)


class Floors:
    """The floor for robots of each model, under some closures. `narrow` are the sets of nodes that
    are entered by one robot at a time. With many `robots` there are lanes."""

    def __init__(self, lattice: Lattice, closures: Sequence[Closure] = (), robots: int = 1) -> None:
        self._lattice, self.closures = lattice, tuple(closures)
        self.lanes = with_lanes(lattice, robots)
        self._floors: dict[tuple[Closure, ...], Floor] = {}
        one = (closure.region_m for closure in closures if closure.one_at_a_time)
        self.narrow = tuple(nodes_about(lattice, regions) for regions in one)

    def of(self, model: str) -> Floor:
        """Where robots of a model may drive."""
        closures = shut(self.closures, model)
        if closures not in self._floors:
            self._floors[closures] = Floor(self._lattice, closures, self.lanes)
        return self._floors[closures]


def nodes_in(lattice: Lattice, regions: Sequence[Rectangle]) -> frozenset[int]:
    """The nodes at which the largest robot would be in one of the regions, in part at least."""
    if not regions:
        return frozenset()
    return frozenset(np.flatnonzero(_within(lattice.points_m, regions)).tolist())


def nodes_about(lattice: Lattice, regions: Sequence[Rectangle]) -> frozenset[int]:
    """As `nodes_in`, with both ends of every step that leads through one of the regions."""
    through = _steps_through(lattice, regions)
    return nodes_in(lattice, regions) | {node for step in through for node in step}


def _within(
    points: Floats, regions: Sequence[Rectangle], margin_m: float = LARGEST_RADIUS_M
) -> NDArray[np.bool_]:
    """Which of the points `(…, 2)` lie in a region, or nearer to it than the margin: `(…)`."""
    boxes = np.asarray(regions)  # (n, 4)
    low, high = boxes[:, :2] - margin_m, boxes[:, 2:] + margin_m
    each = points[..., None, :]
    inside: NDArray[np.bool_] = np.asarray(((each > low) & (each < high)).all(axis=-1))
    return np.asarray(inside.any(axis=-1))


def _steps_through(lattice: Lattice, regions: Sequence[Rectangle]) -> frozenset[Pair]:
    """Steps of the lattice, in both directions, that lead through one of the regions."""
    if not regions:
        return frozenset()
    pairs = lattice.edges.tolist()
    pairs += [[u, v] for u, ways in enumerate(lattice.diagonals) for v in ways if u < v]
    if not pairs:
        return frozenset()
    ends = np.asarray(pairs)
    start, end = lattice.points_m[ends[:, 0]], lattice.points_m[ends[:, 1]]
    longest = float(np.linalg.norm(end - start, axis=1).max())
    share = np.linspace(0.0, 1.0, max(2, int(np.ceil(longest / SAMPLE_M)) + 1))
    points = start[:, None] + share[None, :, None] * (end - start)[:, None]  # (k, s, 2)
    crossing = _within(points, regions, 0.0).any(axis=1)
    found = [(u, v) for u, v in ends[crossing].tolist()]
    return frozenset(found) | {(v, u) for u, v in found}
