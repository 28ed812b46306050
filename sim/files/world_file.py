"""Loads world, robot and mission files and checks that what they say can be.

Every public function raises `BadFile` with one sentence that names the file, the place in it, what
is wrong and what would be right.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import msgspec

from keyexpr_schema.config_files import config_file
from keyexpr_schema.errors import InvalidId, NoConfigFile
from keyexpr_schema.ids import Id, check_id
from keyexpr_schema.payloads.robots import PoseMRad, RobotSpec
from sim.errors import BadFile
from sim.files.world_schema import (
    FLOOR,
    LARGEST_RADIUS_M,
    Mission,
    MissionRobot,
    PlanOptions,
    PointXY,
    Solid,
    WorldFile,
)
from sim.files.yaml_file import FileEntry, read_yaml

__all__ = [
    "Mission",
    "MissionRobot",
    "PlanOptions",
    "WorldFile",
    "load_mission",
    "load_robot",
    "load_world",
]


class _Start(FileEntry, frozen=True):
    at_m: PointXY
    yaw_deg: float = 0.0


class _RobotEntry(FileEntry, frozen=True):
    spec: str
    start: _Start
    robot: Id | None = None
    """A name of its own, so that a mission can have several of one specification."""


class _Placement(FileEntry, frozen=True):
    on: str
    at_m: tuple[float, float]
    yaw_deg: float = 0.0


class _MissionEntry(FileEntry, frozen=True):
    mission: Id
    world: str
    robots: Annotated[tuple[_RobotEntry, ...], msgspec.Meta(min_length=1)]
    objects: dict[Id, _Placement | None] = {}
    """Where things lie in this mission and not where the world file says; `null`: not there."""
    statements: tuple[str, ...] = ()
    goals: tuple[str, ...] = ()
    plan: PlanOptions = PlanOptions()


def load_world(name: str | Path, named_in: Path | None = None) -> WorldFile:
    """The world file given by path or name (see `config_file`), checked."""
    path = _file("worlds", name, named_in)
    world = read_yaml(path, WorldFile, "world file")
    _check_world(path, world)
    return world


def load_robot(name: str | Path) -> RobotSpec:
    """The robot file given by path or name (see `config_file`), checked."""
    path = _file("robots", name)
    spec = read_yaml(path, RobotSpec, "robot file")
    for name, value in spec.capabilities.items():
        if not (math.isfinite(value) and value >= 0.0):
            raise BadFile(f"{path}: capabilities.{name}: {value} is not a number from 0 up")
    if spec.capabilities.get("drive", 0.0) <= 0.0:
        raise BadFile(
            f"{path}: capabilities: it lacks `drive`, the robot's top speed in m/s (such as 0.6)"
        )
    return spec


def load_mission(name: str | Path) -> Mission:
    """The mission given by path or name (see `config_file`), with its world and robots."""
    path = _file("missions", name)
    entry = read_yaml(path, _MissionEntry, "mission file")
    world = _rearranged(path, load_world(entry.world, path), entry.objects)
    robots: list[MissionRobot] = []
    for number, item in enumerate(entry.robots):
        file = _file("robots", item.spec, path)
        spec = load_robot(file)
        if item.robot is not None:
            spec = msgspec.structs.replace(spec, robot=item.robot)
        start = (*item.start.at_m, math.radians(item.start.yaw_deg))
        where = f"{path}: robots[{number}] ({spec.robot})"
        _check_start(where, world, spec.robot, start, robots)
        robots.append(MissionRobot(spec=spec, start_m_rad=start, folder=file.parent))
    return Mission(
        mission=entry.mission,
        world=world,
        robots=tuple(robots),
        statements=entry.statements,
        goals=entry.goals,
        plan=entry.plan,
    )


def _file(kind: str, name: str | Path, named_in: Path | None = None) -> Path:
    try:
        return config_file(kind, name, named_in)
    except NoConfigFile as error:
        raise BadFile(str(error)) from None


def _rearranged(
    path: Path, world: WorldFile, placements: dict[str, _Placement | None]
) -> WorldFile:
    """The world with a mission's objects put elsewhere or taken away."""
    entries = dict(world.object_entries)
    for name, placement in placements.items():
        if name not in entries:
            raise BadFile(
                f"{path}: objects.{name}: the world has no such object; "
                f"it has {', '.join(world.object_entries) or 'none'}"
            )
        if placement is None:
            del entries[name]
        else:
            entries[name] = msgspec.structs.replace(
                entries[name], on=placement.on, at_m=placement.at_m, yaw_deg=placement.yaw_deg
            )
    rearranged = msgspec.structs.replace(world, object_entries=entries)
    _check_objects(path, rearranged)
    return rearranged


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
    _check_objects(path, world)


def _check_objects(path: Path, world: WorldFile) -> None:
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


def _check_start(
    where: str, world: WorldFile, robot: str, start: PoseMRad, others: list[MissionRobot]
) -> None:
    x, y, _ = start
    if robot in world.place_entries or robot in world.object_entries:
        raise BadFile(f"{where}: a place or an object has the name {robot!r}; use another")
    if not (0 <= x <= world.size_m[0] and 0 <= y <= world.size_m[1]):
        raise BadFile(
            f"{where}: start.at_m: [{x}, {y}] is outside the building "
            f"(x 0 to {world.size_m[0]}, y 0 to {world.size_m[1]})"
        )
    for solid in world.solids():
        if _distance(solid, x, y) < LARGEST_RADIUS_M:
            raise BadFile(
                f"{where}: start.at_m: [{x}, {y}] is less than {LARGEST_RADIUS_M} m from "
                f"{solid.name}; a robot needs that much room"
            )
    for other in others:
        if other.spec.robot == robot:
            raise BadFile(
                f"{where}: there are two robots {robot!r}; give one another name with `robot: …`"
            )
        gap = math.dist(start[:2], other.start_m_rad[:2])
        if gap < 2 * LARGEST_RADIUS_M:
            raise BadFile(
                f"{where}: start.at_m: it overlaps {other.spec.robot}, {gap:.2f} m away; "
                f"keep {2 * LARGEST_RADIUS_M} m between two robots"
            )


def _distance(solid: Solid, x: float, y: float) -> float:
    """From a point to the box, m; 0 inside."""
    c, s = math.cos(solid.yaw_rad), math.sin(solid.yaw_rad)
    dx, dy = x - solid.center_m[0], y - solid.center_m[1]
    along = max(abs(c * dx + s * dy) - solid.half_m[0], 0.0)
    across = max(abs(c * dy - s * dx) - solid.half_m[1], 0.0)
    return math.hypot(along, across)
