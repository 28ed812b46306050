"""Reads missions: a world, what the planner believes of it, sentences, and what must come true."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Literal

import msgspec
from msgspec.structs import replace

from benchmarks.planning.expectations import Expectation, parse_expectation
from keyexpr_schema.payloads.robots import PoseMRad, RobotSpec
from keyexpr_schema.payloads.world import Place
from sim.errors import BadFile
from sim.files.mission_file import load_robot
from sim.files.world_file import load_world
from sim.files.world_payloads import place_payloads
from sim.files.world_schema import WorldFile
from sim.files.yaml_file import FileEntry, read_yaml

HERE = Path(__file__).parent
CLASSES = ("simple", "compound", "complex", "vague")
Outcome = Literal["done", "refused", "given-up"]
"""`refused`: nothing may be done; `given-up`: tried in vain. Both want a sentence that says why."""


class MissionEntry(FileEntry, frozen=True):
    """One mission as it is written down.

    The planner believes what is so of every object's place and support, but for those in `unknown`
    and those that it believes elsewhere (`believed`). `placed` puts objects elsewhere than the
    world file: `[table or floor, x_m, y_m]`. Objects in `missing` exist in sentences only. `final`
    must hold at the end, `stages` one after the other on the way there. What neither names must not
    have been moved.
    """

    mission: str
    setting: str
    robots: tuple[str, ...]
    goals: tuple[str, ...]
    placed: dict[str, tuple[str, float, float]] = {}
    missing: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    believed: dict[str, str] = {}
    statements: tuple[str, ...] = ()
    final: tuple[str, ...] = ()
    stages: tuple[tuple[str, ...], ...] = ()
    outcome: Outcome = "done"


class _File(FileEntry, frozen=True):
    missions: tuple[MissionEntry, ...]


class _RobotEntry(FileEntry, frozen=True):
    spec: str
    at_m: tuple[float, float]


class _Setting(FileEntry, frozen=True):
    world: str
    robots: dict[str, _RobotEntry]


class _Settings(FileEntry, frozen=True):
    settings: dict[str, _Setting]


class Mission(msgspec.Struct, frozen=True, kw_only=True):
    """A mission, ready to be run; `world` holds every object that anybody speaks of."""

    entry: MissionEntry
    kind: str
    world: WorldFile
    places: tuple[Place, ...]
    robots: tuple[tuple[RobotSpec, PoseMRad], ...]
    final: tuple[Expectation, ...]
    stages: tuple[tuple[Expectation, ...], ...]

    @property
    def name(self) -> str:
        """The mission's id."""
        return self.entry.mission

    def existing_world(self) -> WorldFile:
        """The world without what only exists in sentences."""
        there = {
            name: entry
            for name, entry in self.world.object_entries.items()
            if name not in self.entry.missing
        }
        return replace(self.world, object_entries=there)

    def start_of(self, thing: str) -> str | None:
        """The place in which an object lies at the start."""
        return self.world.place_at(*self.world.start_point_m(thing)[:2])

    def believed_places(self) -> dict[str, str]:
        """Where the planner believes objects to be at first."""
        known = {
            thing: self.entry.believed.get(thing) or self.start_of(thing)
            for thing in self.world.object_entries
            if thing not in self.entry.unknown and thing not in self.entry.missing
        }
        return {thing: place for thing, place in known.items() if place is not None}

    def believed_supports(self) -> dict[str, str]:
        """What it believes to support those objects whose place it believes rightly."""
        return {
            thing: self.world.object_entries[thing].on
            for thing, place in self.believed_places().items()
            if place == self.start_of(thing)
        }


def load_missions(only: str | None = None) -> tuple[Mission, ...]:
    """All missions (of one class), in the order of the files.

    Raises:
        BadFile: one sentence that names the file and what is wrong in it.
    """
    return tuple(
        _mission(entry, kind, path)
        for kind in CLASSES
        if only in (None, kind)
        for path in [HERE / "missions" / f"{kind}.yaml"]
        for entry in read_yaml(path, _File, "file of missions").missions
    )


@cache
def _setting(
    name: str,
) -> tuple[WorldFile, tuple[Place, ...], dict[str, tuple[RobotSpec, PoseMRad]]]:
    path = HERE / "settings" / "settings.yaml"
    settings = read_yaml(path, _Settings, "file of settings").settings
    if name not in settings:
        raise BadFile(f"{path}: there is no setting {name!r}; there are {', '.join(settings)}")
    found = settings[name]
    robots = {
        robot: (
            replace(load_robot(path.parent / entry.spec), robot=robot),
            (*entry.at_m, math.pi / 2),
        )
        for robot, entry in found.robots.items()
    }
    world = load_world(path.parent / found.world)
    return world, place_payloads(world), robots


def _mission(entry: MissionEntry, kind: str, path: Path) -> Mission:
    world, places, robots = _setting(entry.setting)
    where = f"{path}: {entry.mission}"
    objects = dict(world.object_entries)
    for name in (*entry.placed, *entry.missing, *entry.unknown, *entry.believed):
        if name not in objects:
            raise BadFile(f"{where}: there is no object {name!r}; there are {', '.join(objects)}")
    for thing, (table, x_m, y_m) in entry.placed.items():
        if table != "floor" and table not in world.furniture:
            raise BadFile(f"{where}: there is no table {table!r}")
        objects[thing] = replace(objects[thing], on=table, at_m=(x_m, y_m))
    for robot in entry.robots:
        if robot not in robots:
            raise BadFile(f"{where}: there is no robot {robot!r}; there are {', '.join(robots)}")
    names = (*objects, *world.place_entries, *entry.robots)
    made = Mission(
        entry=entry,
        kind=kind,
        world=replace(world, object_entries=objects),
        places=places,
        robots=tuple(robots[robot] for robot in entry.robots),
        final=tuple(parse_expectation(text, names, where) for text in entry.final),
        stages=tuple(
            tuple(parse_expectation(text, names, where) for text in stage) for stage in entry.stages
        ),
    )
    if entry.outcome == "done" and not made.final:
        raise BadFile(f"{where}: it must say what is true at the end (`final`)")
    return made
