"""Lanes by themselves: in which direction each row and column of the lattice is rather driven.

What a step costs more against its lane guides the distances that robots follow, and so which way
they choose (Zhang et al., "Guidance Graph Optimization for Lifelong Multi-Agent Path Finding",
IJCAI 2024, call it a guidance graph). In a strip that is narrow, a corridor, nobody who is not
pushed drives against a lane: two that meet there keep each other, and all behind them, from
getting on.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim.navigation.lattice import PITCH_M, Lattice

LANE = 0.9
"""What a step against its lane costs more, as a share of its length: found by trial with 30 and 50
robots in a building of rooms along a corridor (`benchmarks/traffic`)."""

SLANT = 1.0
"""The same of a slanted step, which takes the room of four nodes."""

NARROW_NODES = 5
"""So many nodes from wall to wall are a strip with lanes; where there are more, robots pass."""

CROWD_ROBOTS, CROWD_NODES = 8, 200
"""So many robots, with less than so many nodes for each, keep to lanes; fewer take short cuts."""

Pair = tuple[int, int]


def with_lanes(lattice: Lattice, robots: int) -> bool:
    """Whether so many robots keep to lanes there."""
    return robots >= max(CROWD_ROBOTS, len(lattice) / CROWD_NODES)


def lane_costs(lattice: Lattice) -> dict[Pair, float]:
    """What each step costs, m: along narrow strips lanes go in turn one way and the other."""
    points = lattice.points_m
    cells = np.round((points - points.min(axis=0)) / PITCH_M).astype(int).tolist()
    across = _widths(lattice, cells)
    costs: dict[Pair, float] = {}
    for u, steps in enumerate(lattice.steps):
        column, row = cells[u]
        for v, length, corners in steps:
            east, north = cells[v][0] - column, cells[v][1] - row
            share = 0.0
            if corners:
                share = SLANT
            elif 1 < across[u][1 if east else 0] <= NARROW_NODES:
                lane, ahead = (row, east > 0) if east else (column, north > 0)
                share = LANE * (ahead is bool(lane % 2))
            costs[u, v] = length * (1.0 + share)
    return costs


def _widths(lattice: Lattice, cells: Sequence[Sequence[int]]) -> list[list[int]]:
    """Of each node, how many lie in a line with it in x and in y, up to the walls and the doors."""
    doors = {n for n, around in enumerate(lattice.neighbours) if _leads_on(cells, around)}
    widths = [[1, 1] for _ in cells]
    for axis in (0, 1):
        ways = [
            [v for v in around if cells[v][1 - axis] == cells[u][1 - axis] and v not in doors]
            for u, around in enumerate(lattice.neighbours)
        ]
        done: set[int] = set()
        for start in range(len(cells)):
            if start in done or start in doors:
                continue
            line, ahead = {start}, [start]
            while ahead:
                new = set(ways[ahead.pop()]) - line
                line |= new
                ahead += new
            done |= line
            for node in line:
                widths[node][axis] = len(line)
    return widths


def _leads_on(cells: Sequence[Sequence[int]], around: Sequence[int]) -> bool:
    """Whether a node with these neighbours is one on a single straight way, as in a door."""
    if len(around) != 2:
        return False
    a, b = (cells[node] for node in around)
    return a[0] == b[0] or a[1] == b[1]
