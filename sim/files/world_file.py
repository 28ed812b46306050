"""Loads a world file and checks that what it says can be.

What is wrong is a `BadFile` with one sentence that names the file, the place in it, what is wrong
and what would be right.
"""

from __future__ import annotations

import math
from pathlib import Path

from keyexpr_schema.errors import InvalidId
from keyexpr_schema.ids import check_id
from sim.errors import BadFile
from sim.files.world_schema import FLOOR, WorldFile
from sim.files.yaml_file import find_file, read_yaml


def load_world(file: str | Path) -> WorldFile:
    """The world file given by path or name (see `config_file`), checked."""
    path = find_file("worlds", file)
    world = read_yaml(path, WorldFile, "world file")
    _check_world(path, world)
    return world


def _check_world(path: Path, world: WorldFile) -> None:
    def wrong(where: str, what: str) -> BadFile:
        return BadFile(f"{path}: {where}: {what}")

    names = ", ".join(world.place_entries)
    if not world.place_entries:
        raise wrong("places", "there are none; name at least one")
    width, depth = world.size_m
    for name, place in world.place_entries.items():
        _check_name(path, f"places.{name}", name)
        for a, b, c, d in place.region_m:
            if not (0 <= a < c <= width and 0 <= b < d <= depth):
                raise wrong(
                    f"places.{name}.region_m",
                    f"[{a}, {b}, {c}, {d}] is not [x_min, y_min, x_max, y_max] inside the building "
                    f"(x 0 to {width}, y 0 to {depth})",
                )
    for number, wall in enumerate(world.walls):
        if math.dist(wall.from_m, wall.to_m) < world.wall_thickness_m:
            raise wrong(f"walls[{number}]", "it is shorter than it is thick")
    for name, door in world.doors.items():
        for place_name in door.between:
            if place_name not in world.place_entries:
                raise wrong(
                    f"doors.{name}.between", f"there is no place {place_name!r}; there are {names}"
                )
    for name, item in world.furniture.items():
        if item.place not in world.place_entries:
            raise wrong(
                f"furniture.{name}.place", f"there is no place {item.place!r}; there are {names}"
            )
        if world.place_at(*item.center_m) != item.place:
            raise wrong(
                f"furniture.{name}.center_m", f"{list(item.center_m)} is not in {item.place!r}"
            )
    for name, kind in world.object_kinds.items():
        needed = {"cylinder": ("radius_m", "height_m"), "sphere": ("radius_m",), "box": ("size_m",)}
        for field in needed[kind.shape]:
            if getattr(kind, field) is None:
                raise wrong(f"object_kinds.{name}", f"a {kind.shape} needs `{field}`")
    check_objects(path, world)


def check_objects(path: Path, world: WorldFile) -> None:
    """Check where the objects of `world` lie, as the file at `path` says it.

    Raises:
        BadFile: one lies where it cannot.
    """
    tables = [name for name, item in world.furniture.items() if item.kind == "table"]
    for name, entry in world.object_entries.items():
        _check_name(path, f"objects.{name}", name)
        where = f"{path}: objects.{name}"
        if name in world.place_entries:
            raise BadFile(f"{where}: a place has this name already; give the object another")
        if entry.kind not in world.object_kinds:
            raise BadFile(
                f"{where}.kind: there is no kind {entry.kind!r}; "
                f"there are {', '.join(world.object_kinds) or 'none in object_kinds'}"
            )
        if entry.home is not None and entry.home not in world.place_entries:
            raise BadFile(
                f"{where}.home: there is no place {entry.home!r}; "
                f"there are {', '.join(world.place_entries)}"
            )
        if entry.on == FLOOR:
            if world.place_at(*entry.at_m) is None:
                raise BadFile(f"{where}.at_m: {list(entry.at_m)} is in none of the places")
            continue
        if entry.on not in tables:
            raise BadFile(
                f"{where}.on: there is no table {entry.on!r}; "
                f"there are {', '.join([*tables, FLOOR])}"
            )
        top = world.surface(entry.on)
        if abs(entry.at_m[0]) > top.length_m / 2 or abs(entry.at_m[1]) > top.width_m / 2:
            raise BadFile(
                f"{where}.at_m: {list(entry.at_m)} is not on {entry.on}, which reaches "
                f"{top.length_m / 2} m in x and {top.width_m / 2} m in y from its centre"
            )
        for other, placed in world.object_entries.items():
            if other == name:
                break
            sizes = (world.object_kinds[kind].extent_m for kind in (entry.kind, placed.kind))
            needed = sum(max(size[:2]) for size in sizes) / 2
            if placed.on == entry.on and math.dist(placed.at_m, entry.at_m) < needed:
                raise BadFile(
                    f"{where}.at_m: it overlaps {other}; keep {needed:.2f} m between their centres"
                )


def _check_name(path: Path, where: str, name: str) -> None:
    try:
        check_id(name)
    except InvalidId as error:
        raise BadFile(f"{path}: {where}: {error}") from None
