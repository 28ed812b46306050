"""Distances in large buildings: the same as on the whole grid, at the cost of the regions."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from sim.files.world_file import load_world
from sim.files.world_schema import LARGEST_RADIUS_M, WorldFile
from sim.navigation import clearance, travel
from sim.navigation.clearance import Clearance
from sim.navigation.travel import CELL_M, travel_map

HOME = load_world("home")
ROOMS = 3


def travel_m(world: WorldFile) -> dict[str, dict[str, float]]:
    """Driven distance between every two places, m, to the centimetre; none without a way."""
    found = travel_map(world)
    names, nodes = [*found.spots], [*found.spots.values()]
    lengths, _ = found.ways(nodes)
    return {
        name: {
            other: round(float(length), 2)
            for other, length in zip(names, row[nodes], strict=True)
            if other != name and math.isfinite(length)
        }
        for name, row in zip(names, lengths, strict=True)
    }


def rooms(folder: Path) -> WorldFile:
    """Rooms in a square, one of them at an angle to the rest; a corner of its own; a desk askew."""
    side = 4.0 * ROOMS
    lines = [f"world: rooms\nsize_m: [{side}, {side}]\nplaces:"]
    lines.append("  nook: {label: Nook, part_of: r0_0, region_m: [[0.0, 0.0, 1.5, 1.5]]}")
    cells = [(i, j) for i in range(ROOMS) for j in range(ROOMS)]
    for i, j in cells:
        box = [4 * i, 4 * j, 4 * i + 4, 4 * j + 4]
        lines.append(f"  r{i}_{j}: {{label: Room {i} {j}, region_m: [{box}]}}")
    lines.append("walls:")
    for k in range(1, ROOMS):
        lines.append(f"  - {{from_m: [{4 * k}, 0], to_m: [{4 * k}, {side}]}}")
        lines.append(f"  - {{from_m: [0, {4 * k}], to_m: [{side}, {4 * k}]}}")
    lines.append("  - {from_m: [4.6, 1.2], to_m: [6.7, 2.9]}")
    lines.append("doors:")
    for i, j in cells:
        if i + 1 < ROOMS and (i + j) % 3 != 1:
            lines.append(
                f"  e{i}_{j}: {{between: [r{i}_{j}, r{i + 1}_{j}], "
                f"center_m: [{4 * i + 4}, {4 * j + 1.4}], width_m: 1.0}}"
            )
        if j + 1 < ROOMS:
            lines.append(
                f"  n{i}_{j}: {{between: [r{i}_{j}, r{i}_{j + 1}], "
                f"center_m: [{4 * i + 2.6}, {4 * j + 4}], width_m: 0.9}}"
            )
    lines.append("furniture:")
    lines.append(
        "  desk: {kind: table, place: r1_1, center_m: [6.1, 6.2], yaw_deg: 33, "
        "size_m: [1.2, 0.7, 0.6]}"
    )
    path = folder / "rooms.yaml"
    path.write_text("\n".join(lines) + "\n")
    return load_world(path)


def on_the_whole_grid(world: WorldFile) -> dict[str, dict[str, float]]:
    """Dijkstra's algorithm over all cells, from the cell of each place with most room."""
    nx, ny = (int(size / CELL_M) for size in world.size_m)
    x, y = (np.arange(nx) + 0.5) * CELL_M, (np.arange(ny) + 0.5) * CELL_M
    room = Clearance(world).at(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1))
    free, index = room >= LARGEST_RADIUS_M, np.arange(nx * ny).reshape(nx, ny)
    rows, columns, costs = [], [], []
    for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
        a = (slice(0, nx - dx), slice(max(0, -dy), ny - max(0, dy)))
        b = (slice(dx, nx), slice(max(0, dy), ny - max(0, -dy)))
        both = free[a] & free[b]
        rows.append(index[a][both])
        columns.append(index[b][both])
        costs.append(np.full(int(both.sum()), CELL_M * math.hypot(dx, dy)))
    ends = (np.concatenate(rows), np.concatenate(columns))
    graph = coo_array((np.concatenate(costs), ends), shape=(nx * ny, nx * ny)).tocsr()
    spots = []
    for entry in world.place_entries.values():
        inside = np.zeros((nx, ny), dtype=bool)
        for a_x, a_y, c_x, c_y in entry.region_m:
            inside |= ((x >= a_x) & (x <= c_x))[:, None] & ((y >= a_y) & (y <= c_y))[None, :]
        spots.append(int(np.argmax(np.where(inside, room, -1.0))))
    fields = dijkstra(graph, directed=False, indices=spots)
    names = list(world.place_entries)
    return {
        name: {
            other: float(fields[i, spots[j]])
            for j, other in enumerate(names)
            if i != j and math.isfinite(fields[i, spots[j]])
        }
        for i, name in enumerate(names)
    }


def test_distances_are_those_of_the_whole_grid(tmp_path: Path) -> None:
    for world in (HOME, load_world("workshop"), rooms(tmp_path)):
        found, exact = travel_m(world), on_the_whole_grid(world)
        assert {name: set(row) for name, row in found.items()} == {
            name: set(row) for name, row in exact.items()
        }
        for name, row in exact.items():
            assert found[name] == pytest.approx(row, abs=0.006)


def test_where_it_would_be_too_much_work_ways_get_a_little_longer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = rooms(tmp_path)
    exact = travel_m(world)
    monkeypatch.setattr(travel, "WORK", 30_000)
    found = travel_m(world)
    assert found != exact
    for name, row in exact.items():
        for other, length in row.items():
            assert length <= found[name][other] <= 1.1 * length + 1.6


def test_a_way_says_which_doors_it_takes_and_what_is_left_when_one_is_closed() -> None:
    around = travel_map(HOME, {"rug": [(4.5, 0.0, 5.5, 6.0)]})
    start, end = around.spots["kitchen"], around.spots["living_room"]
    lengths, before = around.ways([start])
    passed, node = set[str](), end
    while node != start:
        passed |= around.regions[around.region_of[node]].inside
        node = int(before[0, node])
    assert passed == {"kitchen_door", "living_room_door", "rug"}
    assert float(lengths[0, end]) == pytest.approx(
        travel_m(HOME)["kitchen"]["living_room"], abs=0.01
    )
    shut = [n for n, region in enumerate(around.regions) if "living_room_door" in region.inside]
    lengths, _ = around.ways([start], shut)
    assert math.isinf(lengths[0, end]) and math.isfinite(lengths[0, around.spots["hallway"]])


def test_distances_by_squares_are_exactly_those_to_all_boxes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for world in (load_world("apartment"), rooms(tmp_path)):
        points = np.random.default_rng(3).uniform(-1.0, 1.0 + max(world.size_m), (3000, 2))
        plain = Clearance(world).at(points)
        monkeypatch.setattr(clearance, "MANY", 0)
        assert (Clearance(world).at(points) == plain).all()
        monkeypatch.undo()


def test_the_innermost_place_of_many_points_is_that_of_each(tmp_path: Path) -> None:
    world = rooms(tmp_path)
    corner = msgspec.structs.replace(world.place_entries["nook"], region_m=((2.0, 2.0, 5.0, 3.0),))
    world = msgspec.structs.replace(world, place_entries={**world.place_entries, "gap": corner})
    x = y = np.linspace(-0.5, 12.5, 53)
    names = [*world.place_entries, None]
    grid = world.places_on(x, y)
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    one_by_one = [world.place_at(float(a), float(b)) for a, b in points]
    assert [names[number] for number in grid.ravel()] == one_by_one
    assert [names[number] for number in world.places_of(points)] == one_by_one
