"""What a world file says, as types. Metres, world frame."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import msgspec

from keyexpr_schema.ids import Id
from keyexpr_schema.payloads.world import Surface
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
            for left, low, right, high in place.region_m:
                if left <= x_m <= right and low <= y_m <= high:
                    return name
        return None

    def kind_of(self, object: str) -> ObjectKind:
        """What an object looks like."""
        return self.object_kinds[self.object_entries[object].kind]

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
        return self.surface(entry.on).point_m(*entry.at_m)

    def surfaces(self, place: str | None = None) -> tuple[Surface, ...]:
        """The table tops (of one place), in the order of the file."""
        return tuple(
            self.surface(name)
            for name, entry in self.furniture.items()
            if entry.kind == "table" and place in (None, entry.place)
        )
