"""How far it is to drive from place to place."""

from __future__ import annotations

import numpy as np

from sim.files.world_schema import LARGEST_RADIUS_M, WorldFile
from sim.navigation.clearance import Clearance

CELL_M = 0.1


def travel_m(world: WorldFile) -> dict[str, dict[str, float]]:
    """Driven distance between every two places, m, to the centimetre.

    Shortest path on a grid of `CELL_M` for the largest robot, between each place's roomiest point.
    A place that cannot be reached is left out. Octile steps make a path up to 8 % longer than the
    straight line.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    nx, ny = (int(size / CELL_M) for size in world.size_m)
    x, y = (np.arange(nx) + 0.5) * CELL_M, (np.arange(ny) + 0.5) * CELL_M
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)  # (nx, ny, 2)
    clearance = Clearance(world).at(points)
    free = clearance >= LARGEST_RADIUS_M
    index = np.arange(nx * ny).reshape(nx, ny)
    rows, columns, costs = [], [], []
    for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
        a = (slice(0, nx - dx), slice(max(0, -dy), ny - max(0, dy)))
        b = (slice(dx, nx), slice(max(0, dy), ny - max(0, -dy)))
        both = free[a] & free[b]
        rows.append(index[a][both])
        columns.append(index[b][both])
        costs.append(np.full(int(both.sum()), CELL_M * np.hypot(dx, dy)))
    graph = coo_array(
        (np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))),
        shape=(nx * ny, nx * ny),
    ).tocsr()
    names, spots = list(world.place_entries), []
    for entry in world.place_entries.values():
        inside = np.zeros((nx, ny), dtype=bool)
        for a_x, a_y, c_x, c_y in entry.region_m:
            inside |= (
                (points[..., 0] >= a_x)
                & (points[..., 0] <= c_x)
                & (points[..., 1] >= a_y)
                & (points[..., 1] <= c_y)
            )
        spots.append(int(np.argmax(np.where(inside, clearance, -1.0))))
    fields = dijkstra(graph, directed=False, indices=spots)
    return {
        name: {
            other: round(float(fields[i, spots[j]]), 2)
            for j, other in enumerate(names)
            if j != i and np.isfinite(fields[i, spots[j]])
        }
        for i, name in enumerate(names)
    }
