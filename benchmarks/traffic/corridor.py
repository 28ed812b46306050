"""What a corridor lets through, if no robot ever had to wait for another.

A flow from every door to every other is routed over the nodes of the lattice so that the most can
arrive (a linear programme): each node takes one robot in the time for which a robot that drives on
keeps it. Robots that cross or meet lose more than that, so this is a limit from above.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.files.world_schema import WorldFile
from sim.navigation.lattice import PITCH_M
from sim.navigation.navigator import MARGIN_M
from sim.navigation.spots import Spots
from sim.navigation.steering import NEAR_M, braking_m


def kept_s(speed_m_s: float) -> float:
    """For how long a node is a robot's that drives on: from when it is promised until the next one
    but one is reached."""
    return (braking_m(speed_m_s) + MARGIN_M + 2 * PITCH_M - NEAR_M) / speed_m_s


def corridor_per_minute(world: WorldFile, speed_m_s: float) -> float:
    """Arrivals a minute, if whoever leaves by a door goes to each of the others as often."""
    from scipy.optimize import linprog

    spots = Spots(world)
    points, neighbours = spots.lattice.points, spots.lattice.neighbours
    doors = [min(gate.nodes) for gate in spots.bottlenecks]
    inside = [n for n, xy in enumerate(points) if world.place_at(*xy) == "corridor"]
    nodes = {node: k for k, node in enumerate([*doors, *(n for n in inside if n not in doors)])}
    steps = [(nodes[u], nodes[v]) for u in nodes for v in neighbours[u] if v in nodes]
    kinds, count, width = len(doors), len(nodes), len(steps)
    balance: list[tuple[int, int, float]] = []  # row, column, value; the last column: arrivals
    used: list[tuple[int, int, float]] = []
    for kind in range(kinds):  # where they go
        for step, (u, v) in enumerate(steps):
            column = kind * width + step
            balance += [(kind * count + u, column, 1.0), (kind * count + v, column, -1.0)]
            if v >= kinds:
                used.append((v, column, kept_s(speed_m_s)))
        for door in range(kinds):
            share = 1.0 if door == kind else -1.0 / (kinds - 1)
            balance.append((kind * count + door, kinds * width, share / kinds))
    columns = kinds * width + 1

    def matrix(entries: list[tuple[int, int, float]], rows: int) -> NDArray[np.float64]:
        row, column, value = zip(*entries, strict=True)
        dense: NDArray[np.float64] = np.zeros((rows, columns))
        np.add.at(dense, (row, column), value)
        return dense

    wanted = np.zeros(columns)
    wanted[-1] = -1.0
    found = linprog(
        wanted,
        matrix(used, count),
        np.full(count, 60.0),
        matrix(balance, kinds * count),
        np.zeros(kinds * count),
        method="highs",
    )
    return -float(found.fun or 0.0)
