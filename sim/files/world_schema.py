"""What a world file and a mission file say, as types. Metres, world frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from keyexpr_schema.ids import Id
from keyexpr_schema.payloads.robots import PoseMRad, RobotSpec
from keyexpr_schema.payloads.world import Object, Place, Surface
from sim.files.yaml_file import FileEntry

FLOOR = "floor"
"""Where an object lies that lies on no surface."""

LARGEST_RADIUS_M = 0.25
"""No robot model may be larger on the floor: corridors and parking spots are laid out for it."""

Positive = Annotated[float, msgspec.Meta(gt=0.0)]
PointXY = tuple[float, float]
Rectangle = tuple[float, float, float, float]
Rgba = tuple[float, float, float, float]


class PlaceEntry(FileEntry, frozen=True):
    """A named region of the floor: rectangles `(x_min, y_min, x_max, y_max)`."""

    label: str
    region_m: Annotated[tuple[Rectangle, ...], msgspec.Meta(min_length=1)]
    aliases: tuple[str, ...] = ()


class WallEntry(FileEntry, frozen=True):
    """A wall along a line, `wall_thickness_m` thick; doors are cut out of it."""

    from_m: PointXY
    to_m: PointXY


class DoorEntry(FileEntry, frozen=True):
    """An opening in the wall at `center_m`."""

    between: tuple[Id, Id]
    center_m: PointXY
    width_m: Positive


class FurnitureEntry(FileEntry, frozen=True):
    """A `table` (its top is a surface with the name of the table) or a `block` (in the way only).

    `size_m` is (length along its own x, width along its own y, height).
    """

    kind: Literal["table", "block"]
    place: Id
    center_m: PointXY
    size_m: tuple[Positive, Positive, Positive]
    yaw_deg: float = 0.0


class ObjectKind(FileEntry, frozen=True):
    """What objects of one kind look like; a box has `size_m`, the others a radius.

    `categories` and `uses` are words for them: a bottle is a `drink`, and something to `drink`.
    """

    shape: Literal["cylinder", "box", "sphere"]
    mass_kg: Positive
    radius_m: Positive | None = None
    height_m: Positive | None = None
    size_m: tuple[Positive, Positive, Positive] | None = None
    rgba: Rgba = (0.6, 0.6, 0.6, 1.0)
    categories: tuple[str, ...] = ()
    uses: tuple[str, ...] = ()

    @property
    def extent_m(self) -> tuple[float, float, float]:
        """Length, width and height of the box around it."""
        if self.size_m is not None:
            return self.size_m
        radius = self.radius_m or 0.0
        return (2 * radius, 2 * radius, self.height_m or 2 * radius)


class ObjectEntry(FileEntry, frozen=True):
    """A thing, and where it lies at the start.

    `on` is a table or `floor`; `at_m` counts from the table's centre, in the table's own axes
    (from the world's origin for the floor).
    """

    kind: Id
    on: str
    at_m: PointXY
    label: str = ""
    aliases: tuple[str, ...] = ()
    rgba: Rgba | None = None
    yaw_deg: float = 0.0
    home: Id | None = None
    """The place where it belongs, for those who tidy up."""


@dataclass(frozen=True)
class Solid:
    """An upright box on the floor that nothing drives through.

    `center_m` and `half_m` (half-extents along its own axes) are (x, y); `yaw_rad` turns it.
    """

    kind: Literal["wall", "table", "block"]
    name: str
    center_m: PointXY
    half_m: PointXY
    yaw_rad: float
    height_m: float


class WorldFile(FileEntry, frozen=True):
    """A building, its furniture and the things in it. The outer walls run along its border."""

    world: Id
    size_m: tuple[Positive, Positive]
    place_entries: dict[Id, PlaceEntry] = msgspec.field(name="places")
    wall_height_m: Positive = 1.2
    wall_thickness_m: Positive = 0.1
    walls: tuple[WallEntry, ...] = ()
    doors: dict[Id, DoorEntry] = {}
    furniture: dict[Id, FurnitureEntry] = {}
    object_kinds: dict[Id, ObjectKind] = {}
    object_entries: dict[Id, ObjectEntry] = msgspec.field(name="objects", default_factory=dict)

    def place_at(self, x_m: float, y_m: float) -> str | None:
        """The place that contains the point; the first in the file where several do."""
        for name, place in self.place_entries.items():
            if any(a <= x_m <= c and b <= y_m <= d for a, b, c, d in place.region_m):
                return name
        return None

    def surface(self, name: str) -> Surface:
        """The top of a table."""
        table = self.furniture[name]
        return Surface(
            surface=name,
            x_m=table.center_m[0],
            y_m=table.center_m[1],
            z_m=table.size_m[2],
            yaw_rad=math.radians(table.yaw_deg),
            length_m=table.size_m[0],
            width_m=table.size_m[1],
        )

    def start_point_m(self, object: str) -> tuple[float, float, float]:
        """Where the centre of an object's base is at the start."""
        entry = self.object_entries[object]
        if entry.on == FLOOR:
            return (entry.at_m[0], entry.at_m[1], 0.0)
        top = self.surface(entry.on)
        c, s = math.cos(top.yaw_rad), math.sin(top.yaw_rad)
        x, y = entry.at_m
        return (top.x_m + c * x - s * y, top.y_m + s * x + c * y, top.z_m)

    def solids(self) -> tuple[Solid, ...]:
        """Everything that stands in the way on the floor: outer walls, inner walls, furniture."""
        return (*_outer_walls(self), *_inner_walls(self), *_furniture(self))

    def surfaces(self, place: str | None = None) -> tuple[Surface, ...]:
        """The table tops (of one place), in the order of the file."""
        return tuple(
            self.surface(name)
            for name, entry in self.furniture.items()
            if entry.kind == "table" and place in (None, entry.place)
        )

    def places(self) -> tuple[Place, ...]:
        """The places as they are made public, with the driven distances between them."""
        from sim.navigation.travel import travel_m

        travel = travel_m(self)
        return tuple(
            Place(
                place=name,
                label=entry.label,
                aliases=entry.aliases,
                region_m=entry.region_m,
                surfaces=self.surfaces(name),
                travel_m=travel[name],
            )
            for name, entry in self.place_entries.items()
        )

    def objects(self) -> tuple[Object, ...]:
        """The objects as they are made public: what they are, and not where."""
        counts: dict[str, int] = {}
        found = []
        for name, entry in self.object_entries.items():
            kind = self.object_kinds[entry.kind]
            counts[entry.kind] = counts.get(entry.kind, 0) + 1
            found.append(
                Object(
                    object=name,
                    kind=entry.kind,
                    label=entry.label or name.replace("_", " "),
                    ordinal=counts[entry.kind],
                    aliases=entry.aliases,
                    mass_kg=kind.mass_kg,
                    home=entry.home,
                    categories=kind.categories,
                    uses=kind.uses,
                )
            )
        return tuple(found)


def _outer_walls(world: WorldFile) -> list[Solid]:
    """Just outside the border, so that `size_m` is what is free inside."""
    (x, y), t = world.size_m, world.wall_thickness_m
    height = world.wall_height_m
    return [
        Solid("wall", "wall_south", (x / 2, -t / 2), (x / 2 + t, t / 2), 0.0, height),
        Solid("wall", "wall_north", (x / 2, y + t / 2), (x / 2 + t, t / 2), 0.0, height),
        Solid("wall", "wall_west", (-t / 2, y / 2), (t / 2, y / 2), 0.0, height),
        Solid("wall", "wall_east", (x + t / 2, y / 2), (t / 2, y / 2), 0.0, height),
    ]


def _inner_walls(world: WorldFile) -> list[Solid]:
    pieces: list[Solid] = []
    for number, wall in enumerate(world.walls):
        (x0, y0), (x1, y1) = wall.from_m, wall.to_m
        length = math.hypot(x1 - x0, y1 - y0)
        ux, uy = (x1 - x0) / length, (y1 - y0) / length
        gaps: list[tuple[float, float]] = []
        for door in world.doors.values():
            dx, dy = door.center_m[0] - x0, door.center_m[1] - y0
            along, across = dx * ux + dy * uy, abs(dy * ux - dx * uy)
            if across <= world.wall_thickness_m and 0.0 <= along <= length:
                gaps.append((along - door.width_m / 2, along + door.width_m / 2))
        start = 0.0
        for low, high in [*sorted(gaps), (length, length)]:
            if low - start > 1e-6:
                middle, half = (start + low) / 2, (low - start) / 2
                pieces.append(
                    Solid(
                        "wall",
                        f"wall_{number}_{len(pieces)}",
                        (x0 + ux * middle, y0 + uy * middle),
                        (half, world.wall_thickness_m / 2),
                        math.atan2(uy, ux),
                        world.wall_height_m,
                    )
                )
            start = max(start, high)
    return pieces


def _furniture(world: WorldFile) -> list[Solid]:
    return [
        Solid(
            entry.kind,
            name,
            entry.center_m,
            (entry.size_m[0] / 2, entry.size_m[1] / 2),
            math.radians(entry.yaw_deg),
            entry.size_m[2],
        )
        for name, entry in world.furniture.items()
    ]


class PlanOptions(FileEntry, frozen=True):
    """Which planner and which allocator; `None` leaves it to the planner's own settings."""

    strategy: str | None = None
    planner: str | None = None
    allocator: str | None = None


class MissionRobot(msgspec.Struct, frozen=True, kw_only=True):
    """A robot of a mission, where the simulation puts it, and the folder of its robot file."""

    spec: RobotSpec
    start_m_rad: PoseMRad
    folder: Path


class Mission(msgspec.Struct, frozen=True, kw_only=True):
    """A world, robots in it, what is said about it and what is wanted."""

    mission: Id
    world: WorldFile
    robots: tuple[MissionRobot, ...]
    statements: tuple[str, ...]
    goals: tuple[str, ...]
    plan: PlanOptions
