"""How far it is to drive from place to place, and through what.

The floor is a grid of `CELL_M` for the largest robot, and a map of regions: what has one innermost
place, and each doorway and zone by itself. A shortest way goes from border to border, by the grid's
shortest path inside each region (octile steps: up to 8 % longer than the straight line). So no
search spreads over the whole building, and time and memory grow with its area, not with its area
times its rooms.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sim.files.solids import Solid, doorways
from sim.files.world_schema import LARGEST_RADIUS_M, Rectangle, WorldFile
from sim.navigation.clearance import Clearance, Floats

if TYPE_CHECKING:
    from scipy.sparse import csr_array

CELL_M = 0.1
WORK = 20_000_000
"""Cells that are looked at in all searches; about five seconds."""
STRIP = 100_000
"""Cells whose clearance is worked out at a time: what bounds the memory."""
SOURCES = 16
"""Cells from which distances inside a region are worked out at a time."""
_AROUND = ((1, 0), (0, 1), (1, 1), (1, -1))

Cells = NDArray[np.intp]
Slices = tuple[slice, slice]


@dataclass(frozen=True)
class Region:
    """A part of the floor: its innermost place, and the doors and zones that it lies in."""

    place: str | None
    inside: frozenset[str]


@dataclass(frozen=True)
class TravelMap:
    """Nodes on both sides of the passages, and one in each place; edges that join them.

    `regions[region_of[n]]` is where node `n` is. `edges` `(k, 2)` are pairs of nodes that are
    neighbours across a border or lie in one region, `lengths_m` `(k,)` what is between them.
    """

    regions: tuple[Region, ...]
    region_of: Cells
    spots: Mapping[str, int]
    """The node of each place: where it has most room."""
    edges: Cells
    lengths_m: Floats

    def ways(
        self, starts: Collection[int], closed: Collection[int] = ()
    ) -> tuple[Floats, NDArray[np.int32]]:
        """Shortest distances from nodes to all nodes [m], `inf` where there is no way, and of each
        node the one before it on the way, negative for none; both `(len(starts), nodes)`.

        `closed` are the numbers of regions that nobody passes.
        """
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import dijkstra

        count = len(self.region_of)
        shut = np.isin(self.region_of, [*closed])
        kept = ~shut[self.edges].any(axis=1)
        edges = self.edges[kept]
        graph = coo_array((self.lengths_m[kept], (edges[:, 0], edges[:, 1])), shape=(count, count))
        lengths, before = dijkstra(
            graph.tocsr(), directed=False, indices=np.array([*starts]), return_predecessors=True
        )
        return lengths, before


def travel_map(
    world: WorldFile, zones: Mapping[str, Collection[Rectangle]] | None = None
) -> TravelMap:
    """The map of a world; `zones` are rectangles by the name of the zone."""
    nx, ny = (int(size / CELL_M) for size in world.size_m)
    x = (np.arange(nx, dtype=np.float64) + 0.5) * CELL_M
    y = (np.arange(ny, dtype=np.float64) + 0.5) * CELL_M
    room = _room(world, x, y)
    free = room >= LARGEST_RADIUS_M
    regions, region = _regions(world, zones or {}, x, y)
    spots = {name: _spot(world, name, room, x, y) for name in world.place_entries}
    del room
    passages = _passages(free, region)
    cells = np.unique(np.concatenate([passages.ravel(), np.array([*spots.values()], dtype=int)]))
    across = cells.searchsorted(passages)
    steps = np.where(np.isin(np.abs(np.diff(passages)[:, 0]), (1, ny)), 1.0, math.sqrt(2.0))
    inside = [(across, CELL_M * steps), *_inside(free, region, cells)]
    return TravelMap(
        regions=regions,
        region_of=region.ravel()[cells],
        spots={name: int(cells.searchsorted(cell)) for name, cell in spots.items()},
        edges=np.concatenate([edges for edges, _ in inside]),
        lengths_m=np.concatenate([lengths for _, lengths in inside]),
    )


def _room(world: WorldFile, x: Floats, y: Floats) -> Floats:
    """Distance of each cell's middle to what stands there, m."""
    clearance = Clearance(world)
    strip = max(1, STRIP // len(y))
    return np.concatenate(
        [
            clearance.at(np.stack(np.meshgrid(x[k : k + strip], y, indexing="ij"), axis=-1))
            for k in range(0, len(x), strip)
        ]
    )


def _regions(
    world: WorldFile, zones: Mapping[str, Collection[Rectangle]], x: Floats, y: Floats
) -> tuple[tuple[Region, ...], Cells]:
    """The regions, and the number of that which each cell is in."""
    names = [*world.place_entries, None]
    regions = [Region(name, frozenset()) for name in names]
    numbers = {region: number for number, region in enumerate(regions)}
    region = world.places_on(x, y).astype(np.intp)
    region[region < 0] = len(names) - 1

    def lay(name: str, cut: Slices, mask: NDArray[np.bool_]) -> None:
        here = region[cut]
        for number in np.unique(here[mask]):
            old = regions[number]
            new = Region(old.place, old.inside | {name})
            if new not in numbers:
                numbers[new] = len(regions)
                regions.append(new)
            here[mask & (here == number)] = numbers[new]

    for name, rectangles in zones.items():
        for rectangle in rectangles:
            cut = _slices(rectangle, x, y)
            lay(name, cut, np.ones(region[cut].shape, dtype=bool))
    for name, doorway in doorways(world).items():
        reach = math.hypot(*doorway.half_m) + CELL_M
        middle_x, middle_y = doorway.center_m
        around = (middle_x - reach, middle_y - reach, middle_x + reach, middle_y + reach)
        cut = _slices(around, x, y)
        lay(name, cut, _in_box(doorway, x[cut[0]], y[cut[1]]))
    return tuple(regions), region


def _slices(rectangle: Rectangle, x: Floats, y: Floats) -> Slices:
    """The cells whose middle is in a rectangle, its border included."""
    a, b, c, d = rectangle
    return (
        slice(int(x.searchsorted(a, "left")), int(x.searchsorted(c, "right"))),
        slice(int(y.searchsorted(b, "left")), int(y.searchsorted(d, "right"))),
    )


def _in_box(box: Solid, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Which cells are in a doorway: as wide as that, and a cell more on both sides of its wall."""
    c, s = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    dx, dy = x[:, None] - box.center_m[0], y[None, :] - box.center_m[1]
    along, across = np.abs(c * dx + s * dy), np.abs(c * dy - s * dx)
    found: NDArray[np.bool_] = (along <= box.half_m[0]) & (across <= box.half_m[1] + CELL_M)
    return found


def _spot(world: WorldFile, name: str, room: Floats, x: Floats, y: Floats) -> int:
    """The cell of a place with most room; the first of several."""
    best = (-1.0, 0)
    for rectangle in world.place_entries[name].region_m:
        columns, rows = _slices(rectangle, x, y)
        here = room[columns, rows]
        if here.size:
            i, j = divmod(int(here.argmax()), here.shape[1])
            cell = (columns.start + i) * len(y) + rows.start + j
            best = max(best, (float(here[i, j]), -cell))
    return -best[1]


def _passages(free: NDArray[np.bool_], region: Cells) -> Cells:
    """The cells on both sides of each passage, `(p, 2)`.

    Every step over a border is one where searching from all of them is no more work than `WORK`:
    then ways are as short as on the whole grid. Else one of so many of those that lie in a row is.
    """
    straight, slanted = _borders(free, region)
    cells_of = np.bincount(region[free].ravel(), minlength=int(region.max()) + 1)
    every = np.concatenate([*straight, *slanted])
    work = int(cells_of[region.ravel()[every]].sum())
    spacing = -(-work // WORK)
    if spacing <= 1:
        return every
    along = (1, free.shape[1])
    return np.concatenate(
        [
            _thinned(pairs, region, step, spacing)
            for pairs, step in zip(straight, along, strict=True)
        ]
    )


def _borders(
    free: NDArray[np.bool_], region: Cells
) -> tuple[tuple[Cells, Cells], tuple[Cells, Cells]]:
    """The pairs of neighbouring cells in different regions, `(k, 2)` each: in x and y, which come
    along the border, and the two slanted ones."""
    nx, ny = free.shape
    index = np.arange(free.size).reshape(free.shape)
    found = []
    for dx, dy in _AROUND:
        a, b = _shifted(nx, ny, dx, dy)
        border = free[a] & free[b] & (region[a] != region[b])
        turned = border.T if dx == 0 else border
        one, other = (each.T if dx == 0 else each for each in (index[a], index[b]))
        found.append(np.stack([one[turned], other[turned]], axis=1))
    return (found[0], found[1]), (found[2], found[3])


def _thinned(pairs: Cells, region: Cells, along: int, spacing: int) -> Cells:
    """Of pairs in a row between the same two regions one of every `spacing`, the middle one."""
    if not len(pairs):
        return pairs
    sides, step = region.ravel()[pairs], np.diff(pairs[:, 0])
    new = np.ones(len(pairs), dtype=bool)
    new[1:] = (step != along) | (np.diff(sides, axis=0) != 0).any(axis=1)
    starts = np.flatnonzero(new)
    chosen: list[int] = []
    for start, end in zip(starts, [*starts[1:], len(pairs)], strict=True):
        pieces = -(-(end - start) // spacing)
        chosen += (start + (2 * k + 1) * (end - start) // (2 * pieces) for k in range(pieces))
    return pairs[chosen]


def _shifted(nx: int, ny: int, dx: int, dy: int) -> tuple[Slices, Slices]:
    """The parts of a grid in which each cell has a neighbour `(dx, dy)` further, and those."""
    return (
        (slice(0, nx - dx), slice(max(0, -dy), ny - max(0, dy))),
        (slice(dx, nx), slice(max(0, dy), ny - max(0, -dy))),
    )


def _inside(free: NDArray[np.bool_], region: Cells, nodes: Cells) -> Iterator[tuple[Cells, Floats]]:
    """Of each region the pairs of its nodes (as indices of `nodes`), and their distances in it."""
    from scipy.sparse.csgraph import dijkstra

    ny = free.shape[1]
    of_region = region.ravel()[nodes]
    for number, cut in enumerate(_around_each(region)):
        mine = np.flatnonzero(of_region == number)
        if len(mine) < 2:
            continue
        here = free[cut] & (region[cut] == number)
        local = np.cumsum(here).reshape(here.shape) - 1
        columns, rows = np.divmod(nodes[mine], ny)
        columns, rows = columns - cut[0].start, rows - cut[1].start
        standing = here[columns, rows]  # a place without room has its node in what stands there
        mine, sources = mine[standing], local[columns[standing], rows[standing]]
        graph = _grid_graph(here, local)
        for k in range(0, len(mine), SOURCES):
            fields = dijkstra(graph, directed=False, indices=sources[k : k + SOURCES])
            for source, row in zip(range(k, k + len(fields)), fields, strict=True):
                lengths = row[sources[source + 1 :]]
                near = np.isfinite(lengths)
                others = mine[source + 1 :][near]
                yield np.stack([np.full(len(others), mine[source]), others], axis=1), lengths[near]


def _around_each(region: Cells) -> list[Slices]:
    """The rectangle of cells that each region lies in, by its number; empty where it has none."""
    count, numbers = int(region.max()) + 1, region.ravel()

    def between(along: Cells) -> list[slice]:
        first, end = np.full(count, region.size), np.zeros(count, dtype=np.intp)
        np.minimum.at(first, numbers, along)
        np.maximum.at(end, numbers, along + 1)
        return [slice(int(a), int(b)) for a, b in zip(first, end, strict=True)]

    columns, rows = np.indices(region.shape).reshape(2, -1)
    return [*zip(between(columns), between(rows), strict=True)]


def _grid_graph(here: NDArray[np.bool_], local: Cells) -> csr_array[np.float64]:
    """The steps between the cells of a region, each numbered by `local`."""
    from scipy.sparse import coo_array

    nx, ny = here.shape
    rows, columns, costs = [], [], []
    for dx, dy in _AROUND:
        a, b = _shifted(nx, ny, dx, dy)
        both = here[a] & here[b]
        rows.append(local[a][both])
        columns.append(local[b][both])
        costs.append(np.full(int(both.sum()), CELL_M * math.hypot(dx, dy)))
    count = int(here.sum())
    ends = (np.concatenate(rows), np.concatenate(columns))
    return coo_array((np.concatenate(costs), ends), shape=(count, count)).tocsr()
