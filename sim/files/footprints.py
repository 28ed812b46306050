"""Whether things lie where they can: checked by geometry, before physics throws or sinks them.

A footprint is an upright prism: what a thing takes up on the floor plan, between two heights.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from keyexpr_schema.yaml_reader import YamlFile
from sim.errors import BadFile
from sim.files.fixtures import Fixture, Panel
from sim.files.furniture_schema import PointXY
from sim.files.solids import Solid, doorways, walls
from sim.files.world_schema import WALL_M, ObjectKind, WallEntry, WorldFile

TOUCH_M = 0.002
"""Things may touch: what overlaps by less is put right by the physics without a jerk."""


BESIDE_M = (0.05, 0.2, 0.5)
"""So far from a wall one looks for the place behind it, the nearest first [m]."""


@dataclass(frozen=True)
class Footprint:
    """A box along its own axes, turned by `yaw_rad`, or a disc whose radius both halves are."""

    center_m: PointXY
    half_m: PointXY
    low_m: float
    high_m: float
    yaw_rad: float = 0.0
    round: bool = False

    def overlap_m(self, other: Footprint) -> float:
        """How far the two stick into each other on the floor plan, m; negative: how far apart they
        are at least, or above each other."""
        if self.low_m >= other.high_m - TOUCH_M or other.low_m >= self.high_m - TOUCH_M:
            return -math.inf
        reach = math.hypot(*self.half_m) + math.hypot(*other.half_m)
        if math.dist(self.center_m, other.center_m) > reach:
            return -math.inf
        if self.round and other.round:
            gap = math.dist(self.center_m, other.center_m)
            return self.half_m[0] + other.half_m[0] - gap
        if self.round:
            return self.half_m[0] - other._outside_m(self.center_m)
        if other.round:
            return other.half_m[0] - self._outside_m(other.center_m)
        return min(self._along(other, axis) for box in (self, other) for axis in box._axes())

    def _outside_m(self, point_m: PointXY) -> float:
        """How far a point is from a box, m; negative inside: how far in."""
        (ux, uy), _ = self._axes()
        dx, dy = point_m[0] - self.center_m[0], point_m[1] - self.center_m[1]
        along = abs(ux * dx + uy * dy) - self.half_m[0]
        across = abs(ux * dy - uy * dx) - self.half_m[1]
        return math.hypot(max(along, 0.0), max(across, 0.0)) + min(max(along, across), 0.0)

    def _axes(self) -> tuple[PointXY, PointXY]:
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return (c, s), (-s, c)

    def _along(self, other: Footprint, axis: PointXY) -> float:
        """How far the two overlap along a direction: by the separating axis theorem, two boxes do
        not where one of their sides' directions shows a gap."""
        dx, dy = (a - b for a, b in zip(self.center_m, other.center_m, strict=True))
        gap = abs(dx * axis[0] + dy * axis[1])
        return self._half_along(axis) + other._half_along(axis) - gap

    def _half_along(self, axis: PointXY) -> float:
        return sum(
            half * abs(own[0] * axis[0] + own[1] * axis[1])
            for half, own in zip(self.half_m, self._axes(), strict=True)
        )


class _Solid(NamedTuple):
    """`moves`: it is of a door or a drawer, closed as it is here."""

    name: str
    footprint: Footprint
    moves: bool = False


def check_things(file: YamlFile, world: WorldFile) -> None:
    """That no thing sticks into anything that stands there, or into another thing.

    Raises:
        BadFile: one does; the sentence names both, and by how much.
    """
    names = list(world.object_entries)
    things = [_Solid(name, footprint_of(world, name)) for name in names]
    standing = [*_standing(world)]
    near_standing, near_things = _Near(standing), _Near(things)
    for number, (name, thing, _) in enumerate(things):
        below = {*_below(world, name)}
        solids_ = (standing[other] for other in near_standing.to(thing))
        earlier = (things[other] for other in near_things.to(thing) if other < number)
        for other, footprint, moves in (*solids_, *earlier):
            if other in below and (moves or other in world.object_entries):
                continue
            if (overlap := thing.overlap_m(footprint)) > TOUCH_M:
                where = file.at(f"objects.{name}.at_m")
                raise BadFile(
                    f"{where}: {name} sticks {_cm(overlap)} into {other}; move one by that much"
                )


class _Near:
    """Finds which of many solids may touch another one, by the circles around them."""

    def __init__(self, solids_: list[_Solid]) -> None:
        feet = [each.footprint for each in solids_]
        self._center_m = np.array([foot.center_m for foot in feet]).reshape(-1, 2)
        self._reach_m = np.array([math.hypot(*foot.half_m) for foot in feet])

    def to(self, thing: Footprint) -> list[int]:
        """The numbers of those that are near."""
        gap = np.hypot(*(self._center_m - thing.center_m).T)
        near: list[int] = np.flatnonzero(gap < self._reach_m + math.hypot(*thing.half_m)).tolist()
        return near


def _below(world: WorldFile, name: str) -> Iterator[str]:
    """What a thing is on or in, what that is on or in, and at last the fixture."""
    while name in world.object_entries:
        name = world.object_entries[name].carrier
        yield name
    if name in world.fixture_of:
        yield world.fixture_of[name].name


def check_room(file: YamlFile, world: WorldFile, name: str) -> None:
    """That a thing has room in what it is in, and lies with all of its footprint on furniture.

    Raises:
        BadFile: it is too high or too wide, or sticks out over the rim; the sentence says by how
            much.
    """
    entry = world.object_entries[name]
    if entry.carrier in world.object_entries:
        _check_hollow(file, world, name)
    found = world.fixtures.carriers.get(entry.carrier)
    if found is None:
        return
    fixture, carrier = found
    kind = world.kind_of(name)
    shut_in = carrier.roofed or fixture.mover(carrier.thing) is not None
    if shut_in and kind.extent_m[2] > carrier.size_m[2] + TOUCH_M:
        raise BadFile(
            f"{file.at(f'objects.{name}')}: {name} is {_cm(kind.extent_m[2])} high, and "
            f"{entry.carrier} has room for {_cm(carrier.size_m[2])}"
        )
    reach = _reach_m(kind, math.radians(entry.yaw_deg))
    for axis, at, size, room in zip("xy", entry.at_m, reach, carrier.size_m, strict=False):
        over = abs(at) + size / 2 - room / 2
        if over > TOUCH_M:
            most = math.floor(max(room - size, 0.0) / 2 * 1000) / 1000
            raise BadFile(
                f"{file.at(f'objects.{name}.at_m')}: {name} sticks out {_cm(over)} over the rim of "
                f"{entry.carrier} in {axis}; keep it within {most:g} m of the middle"
            )


def _reach_m(kind: ObjectKind, turned_rad: float) -> tuple[float, float]:
    """How long and wide a thing is along the axes of what it is on, turned in them by so much."""
    c, s = abs(math.cos(turned_rad)), abs(math.sin(turned_rad))
    length, width, _ = kind.extent_m
    return (length, width) if kind.round else (c * length + s * width, s * length + c * width)


def _check_hollow(file: YamlFile, world: WorldFile, name: str) -> None:
    """That a thing in a bowl or a box does not stick into its walls."""
    entry, kind = world.object_entries[name], world.kind_of(name)
    around = world.kind_of(entry.carrier)
    if not around.hollow:
        return
    yaw, (x, y) = math.radians(entry.yaw_deg), entry.at_m
    if around.round:
        half_x, half_y = (extent / 2 for extent in kind.extent_m[:2])
        c, s = math.cos(yaw), math.sin(yaw)
        corners = [
            math.hypot(x + c * dx - s * dy, y + s * dx + c * dy)
            for dx in (half_x, -half_x)
            for dy in (half_y, -half_y)
        ]
        out = math.hypot(x, y) + half_x if kind.round else max(corners)
        over = out - (around.extent_m[0] / 2 - WALL_M)
    else:
        reach = _reach_m(kind, yaw)
        over = max(
            abs(at) + size / 2 - (room / 2 - WALL_M)
            for at, size, room in zip(entry.at_m, reach, around.extent_m[:2], strict=True)
        )
    if over > TOUCH_M:
        raise BadFile(
            f"{file.at(f'objects.{name}.at_m')}: {name} sticks {_cm(over)} into the wall of "
            f"{entry.carrier}, which it is in"
        )


def check_doors(file: YamlFile, world: WorldFile) -> None:
    """That each door is cut out of a wall, between the places that it says.

    Raises:
        BadFile: one is on none, and the sentence names the nearest, and how far that is; or it is
            between other places, which the sentence names.
    """
    cut = doorways(world)
    for name, door in world.doors.items():
        if name in cut:
            one, other = (_beside(world, cut[name], side) for side in (-1, 1))
            a, b = door.between
            if not ((a in one and b in other) or (b in one and a in other)):
                near = " and ".join(next(iter(side), "no place") for side in (one, other))
                raise BadFile(
                    f"{file.at(f'doors.{name}.between')}: on its two sides are {near}, "
                    f"not {a} and {b}"
                )
            continue
        gaps = [(_gap_m(wall, door.center_m), number) for number, wall in enumerate(world.walls)]
        nearest = (
            f"the nearest is walls[{min(gaps)[1]}], {min(gaps)[0]:.2f} m away"
            if gaps
            else "there are no inner walls"
        )
        raise BadFile(
            f"{file.at(f'doors.{name}.center_m')}: {list(door.center_m)} is on no wall; {nearest}; "
            "a door's centre lies on the line of the wall that it is cut out of"
        )


def _beside(world: WorldFile, door: Solid, side: int) -> tuple[str, ...]:
    """The places that one gets to through a door on a side of its wall, the innermost first."""
    x, y = door.center_m
    for gap_m in BESIDE_M:
        across = side * (door.half_m[1] + gap_m)
        at = (x - across * math.sin(door.yaw_rad), y + across * math.cos(door.yaw_rad))
        if found := world.places_around(world.place_at(*at)):
            return found
    return ()


def footprint_of(world: WorldFile, name: str) -> Footprint:
    """What an object takes up where it lies at the start."""
    kind = world.kind_of(name)
    x, y, z = world.start_point_m(name)
    length, width, height = kind.extent_m
    return Footprint(
        center_m=(x, y),
        half_m=(length / 2, width / 2),
        low_m=z,
        high_m=z + height,
        yaw_rad=world.start_yaw_rad(name),
        round=kind.round,
    )


def _standing(world: WorldFile) -> Iterator[_Solid]:
    """Walls, and the panels of furniture and people."""
    for wall in walls(world):
        name = " ".join(wall.name.split("_")[:2]) if wall.name.startswith("wall_") else wall.name
        yield _Solid(name, Footprint(wall.center_m, wall.half_m, 0.0, wall.height_m, wall.yaw_rad))
    for name, fixture in world.fixtures.by_name.items():
        yield from (_Solid(name, each) for each in _panels(fixture, fixture.panels))
        for mover in fixture.movers:
            yield from (_Solid(name, each, True) for each in _panels(fixture, mover.panels))


def _panels(fixture: Fixture, panels: Iterable[Panel]) -> Iterator[Footprint]:
    for panel in panels:
        if panel.hollow:
            continue
        x, y, z = fixture.point_m(panel.center_m)
        half_x, half_y, half_z = panel.half_m
        if panel.shape == "sphere":
            half_y = half_z = half_x
        elif panel.shape == "cylinder":
            half_y, half_z = half_x, panel.half_m[1]
        round_ = panel.shape != "box"
        yield Footprint((x, y), (half_x, half_y), z - half_z, z + half_z, fixture.yaw_rad, round_)


def _gap_m(wall: WallEntry, point_m: PointXY) -> float:
    (x0, y0), (x1, y1) = wall.from_m, wall.to_m
    dx, dy = x1 - x0, y1 - y0
    share = ((point_m[0] - x0) * dx + (point_m[1] - y0) * dy) / (dx * dx + dy * dy)
    share = min(1.0, max(0.0, share))
    return math.dist(point_m, (x0 + share * dx, y0 + share * dy))


def _cm(length_m: float) -> str:
    return f"{max(length_m * 100, 0.1):.1f} cm"
