"""Whether things lie where they can: checked by geometry, before physics throws or sinks them.

A footprint is an upright prism: what a thing takes up on the floor plan, between two heights.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from keyexpr_schema.yaml_reader import YamlFile
from sim.errors import BadFile
from sim.files.fixtures import Fixture
from sim.files.furniture_schema import PointXY
from sim.files.solids import doorways, walls
from sim.files.world_schema import FLOOR, WallEntry, WorldFile

TOUCH_M = 0.002
"""Things may touch: what overlaps by less is put right by the physics without a jerk."""


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
    name: str
    footprint: Footprint


def check_floor(file: YamlFile, world: WorldFile) -> None:
    """That no thing that lies on the floor sticks into anything that stands there, or another.

    Raises:
        BadFile: one does; the sentence names both, and by how much.
    """
    lying = [name for name, entry in world.object_entries.items() if entry.carrier == FLOOR]
    if not lying:
        return
    standing = [*_standing(world)]
    for number, name in enumerate(lying):
        thing = footprint_of(world, name)
        others = [_Solid(other, footprint_of(world, other)) for other in lying[:number]]
        for other, footprint in (*standing, *others):
            if (overlap := thing.overlap_m(footprint)) > TOUCH_M:
                where = file.at(f"objects.{name}.at_m")
                raise BadFile(
                    f"{where}: {name} sticks {_cm(overlap)} into {other}; move one by that much"
                )


def check_rim(file: YamlFile, world: WorldFile, name: str) -> None:
    """That a thing lies with all of its footprint on the furniture that it is on or in.

    Raises:
        BadFile: it sticks out over the rim; the sentence says by how much.
    """
    entry = world.object_entries[name]
    found = world.fixtures.carriers.get(entry.carrier)
    if found is None:
        return
    kind = world.kind_of(name)
    extent = kind.extent_m[:2]
    turned = math.radians(entry.yaw_deg)
    c, s = abs(math.cos(turned)), abs(math.sin(turned))
    if kind.shape not in ("box", "open_box"):
        c, s = 1.0, 0.0
    reach = (c * extent[0] + s * extent[1], s * extent[0] + c * extent[1])
    for axis, at, size, room in zip("xy", entry.at_m, reach, found[1].size_m, strict=False):
        over = abs(at) + size / 2 - room / 2
        if over > TOUCH_M:
            most = math.floor(max(room - size, 0.0) / 2 * 1000) / 1000
            raise BadFile(
                f"{file.at(f'objects.{name}.at_m')}: {name} sticks out {_cm(over)} over the rim of "
                f"{entry.carrier} in {axis}; keep it within {most:g} m of the middle"
            )


def check_doors(file: YamlFile, world: WorldFile) -> None:
    """That each door is cut out of a wall.

    Raises:
        BadFile: one is on none; the sentence names the nearest, and how far that is.
    """
    cut = doorways(world)
    for name, door in world.doors.items():
        if name in cut:
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
        round=kind.shape not in ("box", "open_box"),
    )


def _standing(world: WorldFile) -> Iterator[_Solid]:
    """Walls, and the panels of furniture and people."""
    for wall in walls(world):
        name = " ".join(wall.name.split("_")[:2]) if wall.name.startswith("wall_") else wall.name
        yield _Solid(name, Footprint(wall.center_m, wall.half_m, 0.0, wall.height_m, wall.yaw_rad))
    for name, fixture in world.fixtures.by_name.items():
        yield from (_Solid(name, each) for each in _panels(fixture))


def _panels(fixture: Fixture) -> Iterator[Footprint]:
    for panel in (*fixture.panels, *(p for mover in fixture.movers for p in mover.panels)):
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
