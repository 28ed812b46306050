"""Loads mission files and checks that what they say can be (see `world_file`, `robot_file`)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import msgspec

from keyexpr_schema.facts import Value
from keyexpr_schema.ids import Id
from keyexpr_schema.payloads.robots import FULL, Battery, PoseMRad, RobotSpec
from keyexpr_schema.yaml_reader import YamlFile
from sim.errors import BadFile, there_are
from sim.files.footprints import TOUCH_M, Footprint, footprint_of
from sim.files.furniture_schema import Degrees, PointXY
from sim.files.robot_file import check_robot_name, load_robot
from sim.files.solids import solids
from sim.files.world_file import check_objects, load_world
from sim.files.world_schema import FLOOR, LARGEST_RADIUS_M, WorldFile
from sim.files.yaml_file import FileEntry, find_file, read_entries


class PlanOptions(FileEntry, frozen=True):
    """Which planner and which allocator; `None` leaves it to the planner's own settings."""

    strategy: str | None = None
    planner: str | None = None
    allocator: str | None = None


class MissionRobot(msgspec.Struct, frozen=True, kw_only=True):
    """A robot of a mission, where the simulation puts it, and the folder of its robot file.

    `charge` is how full its battery is at the start [%].
    """

    spec: RobotSpec
    start_m_rad: PoseMRad
    folder: Path
    charge: float = FULL


class Mission(msgspec.Struct, frozen=True, kw_only=True):
    """A world, robots in it, statements about it and goals; `speaker` is who says these."""

    mission: Id
    world: WorldFile
    robots: tuple[MissionRobot, ...]
    statements: tuple[str, ...]
    goals: tuple[str, ...]
    plan: PlanOptions
    speaker: Id | None = None


class _Start(FileEntry, frozen=True):
    at_m: PointXY
    yaw_deg: Degrees = 0.0


class _RobotEntry(FileEntry, frozen=True):
    spec: str
    start: _Start
    robot: Id | None = None
    """A name of its own, so that a mission can have several of one specification."""
    battery: Battery | None = None
    """In place of the one that the robot's file says."""
    charge: Annotated[float, msgspec.Meta(gt=0.0, le=FULL)] = FULL
    """How full it is at the start [%]."""


class _Placement(FileEntry, frozen=True):
    on: str = ""
    inside: str = msgspec.field(name="in", default="")
    at_m: PointXY = (0.0, 0.0)
    yaw_deg: Degrees = 0.0


class _MissionEntry(FileEntry, frozen=True):
    mission: Id
    world: str
    robots: Annotated[tuple[_RobotEntry, ...], msgspec.Meta(min_length=1)]
    objects: dict[Id, _Placement | None] = {}
    """Where things lie in this mission and not where the world file says; `null`: not there."""
    states: dict[Id, dict[Id, Value]] = {}
    """How things are at the start in this mission, besides what the world file says."""
    statements: tuple[str, ...] = ()
    goals: tuple[str, ...] = ()
    speaker: Id | None = None
    """The person who says the goals: "me" in them."""
    plan: PlanOptions = PlanOptions()


ROBOT_M = 1.5
"""As high as that, nothing that lies on the floor stands over a robot."""
PASSAGE_M = 2 * (LARGEST_RADIUS_M + 0.05)
"""No robot gets through a door that is narrower: lanes are laid out for the largest, and it may
stray 5 cm to both sides."""


def load_mission(name: str | Path) -> Mission:
    """The mission given by path or name (see `config_file`), with its world and robots."""
    path = find_file("missions", name)
    entry, written = read_entries(path, _MissionEntry, "mission file")
    world = _rearranged(written, load_world(find_file("worlds", entry.world, path)), entry)
    if entry.speaker is not None and entry.speaker not in world.people:
        raise BadFile(
            f"{written.at('speaker')}: there is nobody {entry.speaker!r} in the world; "
            f"{there_are(world.people, entry.speaker, 'no people')}"
        )
    robots: list[MissionRobot] = []
    for number, item in enumerate(entry.robots):
        file = find_file("robots", item.spec, path)
        spec = load_robot(file)
        if item.robot is not None:
            check_robot_name(written.at(f"robots[{number}].robot"), item.robot)
            spec = msgspec.structs.replace(spec, robot=item.robot)
        if item.battery is not None:
            spec = msgspec.structs.replace(spec, battery=item.battery)
        start = (*item.start.at_m, math.radians(item.start.yaw_deg))
        where = f"{written.at(f'robots[{number}]')} ({spec.robot})"
        _check_start(where, world, spec.robot, start, robots)
        if item.charge != FULL and spec.battery is None:
            raise BadFile(f"{where}: charge: {spec.robot} has no `battery`; its file gives none")
        robots.append(
            MissionRobot(spec=spec, start_m_rad=start, folder=file.parent, charge=item.charge)
        )
    _check_passage(written, world, robots)
    return Mission(
        mission=entry.mission,
        world=world,
        robots=tuple(robots),
        statements=entry.statements,
        goals=entry.goals,
        plan=entry.plan,
        speaker=entry.speaker,
    )


def _rearranged(file: YamlFile, world: WorldFile, mission: _MissionEntry) -> WorldFile:
    """The world with a mission's objects put elsewhere or taken away, and in its states."""
    entries = dict(world.object_entries)
    for name, placement in mission.objects.items():
        if name not in entries:
            raise BadFile(
                f"{file.at(f'objects.{name}')}: the world has no such object; "
                f"{there_are(world.object_entries, name)}"
            )
        if placement is None:
            del entries[name]
        else:
            entries[name] = msgspec.structs.replace(
                entries[name],
                on=placement.on,
                inside=placement.inside,
                at_m=placement.at_m,
                yaw_deg=placement.yaw_deg,
            )
    states = {
        name: {**world.states.get(name, {}), **mission.states.get(name, {})}
        for name in dict.fromkeys([*world.states, *mission.states])
        if name in entries or name not in world.object_entries
    }
    rearranged = msgspec.structs.replace(world, object_entries=entries, states=states)
    check_objects(file, rearranged)
    return rearranged


def _check_passage(file: YamlFile, world: WorldFile, robots: list[MissionRobot]) -> None:
    driving = [each.spec.robot for each in robots if each.spec.capabilities.get("drive", 0.0) > 0]
    for name, door in world.doors.items():
        if driving and door.width_m < PASSAGE_M - 1e-9:
            raise BadFile(
                f"{file.at('world')}: the door {name} is {door.width_m:g} m wide, which is "
                f"{100 * (PASSAGE_M - door.width_m):.0f} cm too narrow for {', '.join(driving)}: "
                f"every robot needs {PASSAGE_M:g} m"
            )


def _check_start(
    where: str, world: WorldFile, robot: str, start: PoseMRad, others: list[MissionRobot]
) -> None:
    x, y, _ = start
    if robot in {*world.place_entries, *world.object_entries, *world.fixture_of}:
        raise BadFile(f"{where}: a place or a thing has the name {robot!r}; use another")
    if not (0 <= x <= world.size_m[0] and 0 <= y <= world.size_m[1]):
        raise BadFile(
            f"{where}: start.at_m: [{x}, {y}] is outside the building "
            f"(x 0 to {world.size_m[0]}, y 0 to {world.size_m[1]})"
        )
    for solid in solids(world):
        if solid.distance_m(x, y) < LARGEST_RADIUS_M:
            raise BadFile(
                f"{where}: start.at_m: [{x}, {y}] is less than {LARGEST_RADIUS_M} m from "
                f"{solid.name}; a robot needs that much room"
            )
    standing = Footprint((x, y), (LARGEST_RADIUS_M, LARGEST_RADIUS_M), 0.0, ROBOT_M, round=True)
    for name, entry in world.object_entries.items():
        if entry.carrier == FLOOR and (
            (overlap := standing.overlap_m(footprint_of(world, name))) > TOUCH_M
        ):
            raise BadFile(
                f"{where}: start.at_m: it stands {100 * overlap:.1f} cm into {name}, which lies on "
                f"the floor; a robot needs {LARGEST_RADIUS_M} m around it"
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
