"""The lattice that robots share out among each other: nodes to stop at, edges to drive along."""

from __future__ import annotations

import itertools
import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sim.files.world_schema import LARGEST_RADIUS_M, WorldFile
from sim.navigation.clearance import Clearance, Floats
from sim.navigation.distance_field import DistanceField, Step

TRACKING_M = 0.05
"""How far a robot's controller may stray from its line. Twice that lies between two robots."""

PITCH_M = 2 * LARGEST_RADIUS_M + 2 * TRACKING_M
"""Distance of neighbouring nodes: two of the largest robots stand side by side."""

OFFSET_M = 0.1
"""Steps in which the lattice is shifted about: a line may miss a door's centre by half of that."""

SHIFTS = round(PITCH_M / OFFSET_M)
"""In so many places along each axis a lattice can begin."""

WALL_M = LARGEST_RADIUS_M + TRACKING_M
SLACK_M = 1e-6
PART = 5000
"""So many steps are looked at closely at a time."""


class Lattice:
    """A square lattice laid over a world so that its lines go through the doors.

    `points_m` is `(n, 2)`, `points` the same as pairs. `neighbours[u]` lists the nodes one straight
    step away;
    `diagonals[u]` maps a node one slanted step away to the two corners it cuts: such a step exists
    where the whole square is free, and whoever takes it needs the corners too. `steps[u]` has both.
    """

    def __init__(self, world: WorldFile, clearance: Clearance | None = None) -> None:
        self._clearance = clearance or Clearance(world)
        grid = _Grid(world, self._clearance)
        best: tuple[tuple[int, int], tuple[int, int]] | None = None
        for offset in itertools.product(range(SHIFTS), range(SHIFTS)):
            nodes, edges = grid.lattice(offset)
            parts = _parts(len(nodes), edges)
            sizes = np.bincount(parts) if len(parts) else np.zeros(1, dtype=int)
            main = nodes[parts == int(sizes.argmax())]
            score = (grid.places_at(main), int(sizes.max()))
            if best is None or score > best[0]:
                best = (score, offset)
        assert best is not None
        nodes, self.edges = grid.lattice(best[1])
        self.points_m: Floats = grid.points_m(nodes)
        self.neighbours: list[list[int]] = [[] for _ in range(len(nodes))]
        self.diagonals: list[dict[int, tuple[int, int]]] = [{} for _ in range(len(nodes))]
        for u, v in self.edges.tolist():
            self.neighbours[u].append(v)
            self.neighbours[v].append(u)
        self._slant({(i, j): n for n, (i, j) in enumerate(nodes.tolist())})
        self.parts = _parts(len(nodes), self.edges)
        self.steps = self._all_steps()
        self._field = lru_cache(maxsize=512)(self.new_field)
        self.points = [(float(x), float(y)) for x, y in self.points_m]

    def _slant(self, nodes: dict[tuple[int, int], int]) -> None:
        edges = {tuple(pair) for pair in self.edges.tolist()}
        edges |= {(v, u) for u, v in edges}
        slanted = [
            (u, w, a, b)
            for (i, j), u in nodes.items()
            for dj in (SHIFTS, -SHIFTS)
            if (w := nodes.get((i + SHIFTS, j + dj))) is not None
            and (a := nodes.get((i + SHIFTS, j))) is not None
            and (b := nodes.get((i, j + dj))) is not None
            and {(u, a), (u, b), (a, w), (b, w)} <= edges
        ]
        ends = np.array([(u, w) for u, w, _, _ in slanted], dtype=int).reshape(-1, 2)
        clear = self._clearance.along(self.points_m[ends[:, 0]], self.points_m[ends[:, 1]])
        for (u, w, a, b), room in zip(slanted, clear, strict=True):
            if room >= WALL_M:
                self.diagonals[u][w] = (a, b)
                self.diagonals[w][u] = (a, b)

    def __len__(self) -> int:
        return len(self.points_m)

    def field(self, goals: frozenset[int], blocked: frozenset[int] = frozenset()) -> DistanceField:
        """Driven distance from every node to the nearest of `goals`; `blocked` are not entered."""
        return self._field(goals, blocked)

    def new_field(self, goals: frozenset[int], blocked: frozenset[int]) -> DistanceField:
        """As `field`, of which nobody else has the same."""
        return DistanceField(self.steps, goals, blocked)

    def _all_steps(self) -> list[tuple[Step, ...]]:
        slant_m = PITCH_M * math.sqrt(2.0)
        return [
            (
                *((other, PITCH_M, ()) for other in straight),
                *((other, slant_m, corners) for other, corners in slanted.items()),
            )
            for straight, slanted in zip(self.neighbours, self.diagonals, strict=True)
        ]

    def near(
        self, start_m: tuple[float, float], end_m: tuple[float, float], gap_m: float
    ) -> frozenset[int]:
        """The nodes a robot must own so that nobody else drives within `gap_m` of a segment.

        Those within `gap_m`, and one end of each edge that comes within it though its ends do not.
        """
        start, end = np.asarray(start_m), np.asarray(end_m)
        gap_m -= 1e-6  # a neighbour exactly that far away is far enough
        reach_m = gap_m + float(np.linalg.norm(end - start)) / 2 + PITCH_M
        off = self.points_m - (start + end) / 2
        close = (off**2).sum(axis=1) <= reach_m**2  # an end of whatever comes within the gap
        nodes = np.flatnonzero(close)
        gaps = _segment_gaps(self.points_m[nodes], self.points_m[nodes], start, end)
        owned = set(nodes[gaps < gap_m].tolist())
        edges = self.edges[close[self.edges[:, 0]] & close[self.edges[:, 1]]]
        if len(edges):
            far = dict(zip(nodes.tolist(), gaps.tolist(), strict=True))
            a, b = edges[:, 0], edges[:, 1]
            gaps = _segment_gaps(self.points_m[a], self.points_m[b], start, end)
            for u, v in edges[gaps < gap_m].tolist():
                if u not in owned and v not in owned:
                    owned.add(u if far[u] <= far[v] else v)
        return frozenset(owned)


class _Grid:
    """All points on which a lattice may have a node, `OFFSET_M` apart, and where one can drive.

    A lattice takes each `SHIFTS`th point in x and in y. Nodes are `(n, 2)` columns and rows here.
    """

    def __init__(self, world: WorldFile, clearance: Clearance) -> None:
        counts = [math.ceil(size / PITCH_M) + 1 for size in world.size_m]
        steps = np.array([round(k * OFFSET_M, 2) for k in range(SHIFTS)])
        self._x, self._y = ((np.arange(n)[:, None] * PITCH_M + steps).ravel() for n in counts)
        points = np.stack(np.meshgrid(self._x, self._y, indexing="ij"), axis=-1)  # (nx, ny, 2)
        self._room = clearance.at(points)  # (nx, ny)
        self._free = self._room >= WALL_M
        self._place = world.places_on(self._x, self._y)  # (nx, ny)
        self._clearance = clearance
        self._ways = [self._straight(axis) for axis in (0, 1)]

    def points_m(self, nodes: NDArray[np.intp]) -> Floats:
        """Where nodes are, `(n, 2)`."""
        return np.stack([self._x[nodes[:, 0]], self._y[nodes[:, 1]]], axis=1)

    def places_at(self, nodes: NDArray[np.intp]) -> int:
        """In how many places some of the nodes are."""
        found = np.unique(self._place[nodes[:, 0], nodes[:, 1]])
        return int((found >= 0).sum())

    def lattice(self, offset: tuple[int, int]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The nodes of the lattice with this offset, and the straight edges between them `(k, 2)`,
        as pairs of indices of nodes."""
        cut = (slice(offset[0], None, SHIFTS), slice(offset[1], None, SHIFTS))
        free = self._free[cut]
        number = np.cumsum(free).reshape(free.shape) - 1
        nodes = np.argwhere(free) * SHIFTS + np.asarray(offset)
        pairs = []
        for axis, ways in enumerate(self._ways):
            there = ways[cut]
            last = tuple(slice(None, -1) if k == axis else slice(None) for k in (0, 1))
            after = tuple(slice(1, None) if k == axis else slice(None) for k in (0, 1))
            pairs.append(np.stack([number[last], number[after]], axis=-1)[there[last]])
        edges = np.concatenate(pairs)
        return nodes, edges[np.argsort(edges[:, 0], kind="stable")]

    def _straight(self, axis: int) -> NDArray[np.bool_]:
        """Whether one can drive from a point to the one `PITCH_M` further along an axis.

        Half of `OFFSET_M` from the points between them nothing can be nearer by more than that, so
        most answers follow from those; only the others are looked at closely.
        """
        windows = np.lib.stride_tricks.sliding_window_view(self._room, SHIFTS + 1, axis=axis)
        least = windows.min(axis=-1)  # of each step, the least room at a point on it
        clear = least >= WALL_M + OFFSET_M / 2 + SLACK_M
        open_ = np.argwhere((least >= WALL_M - SLACK_M) & ~clear)
        ends = open_ + np.array([SHIFTS, 0] if axis == 0 else [0, SHIFTS])
        both = self._free[tuple(open_.T)] & self._free[tuple(ends.T)]
        open_, ends = open_[both], ends[both]
        room = [
            self._clearance.along(
                self.points_m(open_[k : k + PART]), self.points_m(ends[k : k + PART])
            )
            for k in range(0, len(open_), PART)
        ]
        found = np.zeros(self._room.shape, dtype=bool)
        found[tuple(slice(size) for size in clear.shape)] = clear
        if room:
            found[tuple(open_.T)] = np.concatenate(room) >= WALL_M
        return found


def _parts(nodes: int, edges: NDArray[np.intp]) -> NDArray[np.int32]:
    """Which connected part each node belongs to."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ones = np.ones(len(edges))
    graph = coo_array((ones, (edges[:, 0], edges[:, 1])), shape=(nodes, nodes))
    labels: NDArray[np.int32] = connected_components(graph, directed=False)[1]
    return labels


def _segment_gaps(a: Floats, b: Floats, start: Floats, end: Floats) -> Floats:
    """Least distance between each segment a to b `(k, 2)` and the one from start to end, m.

    Sampled every 5 cm, which overestimates by less than 1 mm at the gaps that matter (0.5 m).
    """
    count = max(2, int(np.ceil(float(np.linalg.norm(end - start)) / 0.05)) + 1)
    points = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)  # (s, 2)
    along = b - a
    length2 = np.maximum((along**2).sum(axis=1), 1e-12)  # (k,)
    delta = points[:, None] - a  # (s, k, 2)
    share = np.clip((delta * along).sum(axis=2) / length2, 0.0, 1.0)
    gaps: Floats = np.linalg.norm(delta - share[..., None] * along, axis=2).min(axis=0)
    return gaps
