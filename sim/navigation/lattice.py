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

WALL_M = LARGEST_RADIUS_M + TRACKING_M


class Lattice:
    """A square lattice laid over a world so that its lines go through the doors.

    `points_m` is `(n, 2)`, `points` the same as pairs. `neighbours[u]` lists the nodes one straight
    step away;
    `diagonals[u]` maps a node one slanted step away to the two corners it cuts: such a step exists
    where the whole square is free, and whoever takes it needs the corners too. `steps[u]` has both.
    """

    def __init__(self, world: WorldFile, clearance: Clearance | None = None) -> None:
        self._clearance = clearance or Clearance(world)
        best: tuple[tuple[int, int], tuple[float, float]] | None = None
        steps = [round(k * OFFSET_M, 2) for k in range(round(PITCH_M / OFFSET_M))]
        for offset in itertools.product(steps, steps):
            self._lay(world, offset)
            parts = self._parts()
            sizes = np.bincount(parts) if len(parts) else np.zeros(1, dtype=int)
            main = parts == int(sizes.argmax())
            reached = {world.place_at(x, y) for x, y in self.points_m[main]}
            score = (len(reached - {None}), int(sizes.max()))
            if best is None or score > best[0]:
                best = (score, offset)
        assert best is not None
        self._slant(self._lay(world, best[1]))
        self.parts = self._parts()
        self.steps = self._all_steps()
        self._field = lru_cache(maxsize=512)(self.new_field)
        self.points = [(float(x), float(y)) for x, y in self.points_m]

    def _lay(self, world: WorldFile, offset: tuple[float, float]) -> dict[tuple[int, int], int]:
        """Nodes and straight edges of the lattice at `offset`; the nodes by column and row."""
        nx, ny = (math.ceil(size / PITCH_M) + 1 for size in world.size_m)
        ij = np.array(list(itertools.product(range(nx), range(ny))))
        points = ij * PITCH_M + np.asarray(offset)
        keep = self._clearance.at(points) >= WALL_M
        self.points_m: Floats = points[keep]
        nodes = {(int(i), int(j)): n for n, (i, j) in enumerate(ij[keep])}
        self.neighbours: list[list[int]] = [[] for _ in nodes]
        self.diagonals: list[dict[int, tuple[int, int]]] = [{} for _ in nodes]
        pairs = [
            (u, nodes[(i + di, j + dj)])
            for (i, j), u in nodes.items()
            for di, dj in ((1, 0), (0, 1))
            if (i + di, j + dj) in nodes
        ]
        ends = np.array(pairs, dtype=int).reshape(-1, 2)
        clear = self._clearance.along(self.points_m[ends[:, 0]], self.points_m[ends[:, 1]])
        edges = []
        for (u, v), room in zip(pairs, clear, strict=True):
            if room >= WALL_M:
                self.neighbours[u].append(v)
                self.neighbours[v].append(u)
                edges.append((u, v))
        self.edges = np.array(edges, dtype=int).reshape(-1, 2)
        return nodes

    def _slant(self, nodes: dict[tuple[int, int], int]) -> None:
        edges = {tuple(pair) for pair in self.edges.tolist()}
        edges |= {(v, u) for u, v in edges}
        slanted = [
            (u, w, a, b)
            for (i, j), u in nodes.items()
            for dj in (1, -1)
            if (w := nodes.get((i + 1, j + dj))) is not None
            and (a := nodes.get((i + 1, j))) is not None
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

    def _parts(self) -> NDArray[np.int32]:
        """Which connected part each node belongs to."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        n = len(self)
        ones = np.ones(len(self.edges))
        graph = coo_array((ones, (self.edges[:, 0], self.edges[:, 1])), shape=(n, n))
        labels: NDArray[np.int32] = connected_components(graph, directed=False)[1]
        return labels

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
