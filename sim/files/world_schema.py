"""What a world file says, as types. Metres, world frame."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from keyexpr_schema.facts import IS_OPEN, Value
from keyexpr_schema.ids import Id
from keyexpr_schema.payloads.world import Feature, Surface
from sim.files.catalogue import build
from sim.files.fixtures import Fixture, Fixtures
from sim.files.furniture_schema import (
    Coordinate,
    Degrees,
    FurnitureEntry,
    FurnitureLength,
    PersonEntry,
    PointXY,
    Positive,
    Rgba,
    Side,
    ThingLength,
    ThingMass,
)
from sim.files.yaml_file import FileEntry

FLOOR = "floor"
"""Where an object lies that lies on no surface."""

FLOOR_M = 0.006
"""How thick the floor of a box or bowl is."""
WALL_M = 0.005
"""And its walls."""

LARGEST_RADIUS_M = 0.25
"""No robot model may be larger on the floor: corridors and parking spots are laid out for it."""

Floats = NDArray[np.float64]
WallHeight = Annotated[float, msgspec.Meta(ge=0.1, le=20.0)]
WallThickness = Annotated[float, msgspec.Meta(ge=0.01, le=2.0)]
Rectangle = tuple[Coordinate, Coordinate, Coordinate, Coordinate]


class PlaceEntry(FileEntry, frozen=True):
    """A named region of the floor: rectangles `(x_min, y_min, x_max, y_max)`.

    `part_of` is the place that it lies in: the room of a corner, the flat of a room.
    """

    label: str
    region_m: Annotated[tuple[Rectangle, ...], msgspec.Meta(min_length=1)]
    aliases: tuple[str, ...] = ()
    part_of: Id | None = None

    def contains(self, x_m: float, y_m: float) -> bool:
        """Whether the point lies in the region, borders included."""
        return any(a <= x_m <= c and b <= y_m <= d for a, b, c, d in self.region_m)


class WallEntry(FileEntry, frozen=True):
    """A wall along a line, `wall_thickness_m` thick; doors are cut out of it."""

    from_m: PointXY
    to_m: PointXY


class DoorEntry(FileEntry, frozen=True):
    """An opening in the wall at `center_m`."""

    between: tuple[Id, Id]
    center_m: PointXY
    width_m: FurnitureLength


class ZoneEntry(FileEntry, frozen=True):
    """A part of the floor that is no place for things to be, and can be closed to robots:
    rectangles `(x_min, y_min, x_max, y_max)`."""

    region_m: Annotated[tuple[Rectangle, ...], msgspec.Meta(min_length=1)]
    label: str = ""


class ObjectKind(FileEntry, frozen=True):
    """What objects of one kind look like; a box has `size_m`, the others a radius.

    An `open_box` and a `bowl` are open at the top: others can be in them. `is` names the kinds that
    it is a case of. `categories` and `uses` are words for them: a bottle is a `drink`, and
    something to `drink`. `features` are what else it is good for (a plate `supports`), `room` is
    how many things there can be on or in it.
    """

    shape: Literal["cylinder", "box", "sphere", "open_box", "bowl"]
    mass_kg: ThingMass
    radius_m: ThingLength | None = None
    height_m: ThingLength | None = None
    size_m: tuple[ThingLength, ThingLength, ThingLength] | None = None
    rgba: Rgba = (0.6, 0.6, 0.6, 1.0)
    categories: tuple[str, ...] = ()
    uses: tuple[str, ...] = ()
    parents: tuple[Id, ...] = msgspec.field(name="is", default=())
    features: tuple[str, ...] = ()
    properties: dict[str, Value] = {}
    room: Positive | None = None

    @property
    def hollow(self) -> bool:
        """Whether it is open at the top, and things can be in it."""
        return self.shape in ("open_box", "bowl")

    @property
    def round(self) -> bool:
        """Whether it takes up a circle of the floor plan, not a rectangle."""
        return self.shape not in ("box", "open_box")

    @property
    def carries(self) -> bool:
        """Whether things can be on it or in it."""
        return self.hollow or Feature.SUPPORTS in self.features

    @property
    def extent_m(self) -> tuple[float, float, float]:
        """Length, width and height of the box around it."""
        if self.size_m is not None:
            return self.size_m
        radius = self.radius_m or 0.0
        return (2 * radius, 2 * radius, self.height_m or 2 * radius)


class ObjectEntry(FileEntry, frozen=True):
    """A thing, and where it lies at the start.

    `on` (or `in`, which means the same) is anything that things can be on or in, or `floor`; `at_m`
    counts from its middle, in its own axes (from the world's origin for the floor).
    """

    kind: Id
    on: str = ""
    inside: str = msgspec.field(name="in", default="")
    at_m: PointXY = (0.0, 0.0)
    label: str = ""
    aliases: tuple[str, ...] = ()
    rgba: Rgba | None = None
    yaw_deg: Degrees = 0.0
    home: Id | None = None
    """The place where it belongs, for those who tidy up."""
    properties: dict[str, Value] = {}

    @property
    def carrier(self) -> str:
        """What it is on or in."""
        return self.on or self.inside


class WorldFile(FileEntry, frozen=True, dict=True):
    """A building, its furniture and the things in it. The outer walls run along its border."""

    world: Id
    size_m: tuple[Side, Side]
    place_entries: dict[Id, PlaceEntry] = msgspec.field(name="places")
    wall_height_m: WallHeight = 1.2
    wall_thickness_m: WallThickness = 0.1
    walls: tuple[WallEntry, ...] = ()
    doors: dict[Id, DoorEntry] = {}
    zones: dict[Id, ZoneEntry] = {}
    furniture: dict[Id, FurnitureEntry] = {}
    people: dict[Id, PersonEntry] = {}
    object_kinds: dict[Id, ObjectKind] = {}
    object_entries: dict[Id, ObjectEntry] = msgspec.field(name="objects", default_factory=dict)
    states: dict[Id, dict[Id, Value]] = {}
    """How things are at the start: `fridge: {is_open: true}`, `plate_1: {clean: false}`."""

    def place_at(self, x_m: float, y_m: float) -> str | None:
        """The innermost place that contains the point; the first in the file where several do."""
        for name in self._inner_places_first:
            if self.place_entries[name].contains(x_m, y_m):
                return name
        return None

    def places_on(self, x_m: Floats, y_m: Floats) -> NDArray[np.int32]:
        """As `place_at`, of all points of a grid with these columns and rows, in rising order: the
        number of the place in the file, -1 for none; `(len(x_m), len(y_m))`."""
        found = np.full((len(x_m), len(y_m)), -1, dtype=np.int32)
        numbers = {name: number for number, name in enumerate(self.place_entries)}
        for name in reversed(self._inner_places_first):
            for a, b, c, d in self.place_entries[name].region_m:
                left, right = x_m.searchsorted(a, "left"), x_m.searchsorted(c, "right")
                low, high = y_m.searchsorted(b, "left"), y_m.searchsorted(d, "right")
                found[left:right, low:high] = numbers[name]
        return found

    def places_of(self, points_m: Floats) -> NDArray[np.int32]:
        """As `places_on`, of single points `(k, 2)`."""
        found = np.full(len(points_m), -1, dtype=np.int32)
        numbers = {name: number for number, name in enumerate(self.place_entries)}
        x, y = points_m[:, 0], points_m[:, 1]
        for name in reversed(self._inner_places_first):
            for a, b, c, d in self.place_entries[name].region_m:
                found[(a <= x) & (x <= c) & (b <= y) & (y <= d)] = numbers[name]
        return found

    @cached_property
    def _inner_places_first(self) -> list[str]:
        return sorted(self.place_entries, key=lambda name: -len(self.places_around(name)))

    def places_around(self, place: str | None) -> tuple[str, ...]:
        """A place, the one that it is part of, and so on; none for no place."""
        found: list[str] = []
        while place is not None and place not in found:
            found.append(place)
            place = self.place_entries[place].part_of
        return tuple(found)

    def kind_of(self, object: str) -> ObjectKind:
        """What an object looks like."""
        return self.object_kinds[self.object_entries[object].kind]

    @cached_property
    def fixtures(self) -> Fixtures:
        """What furniture and people are made of, and where they stand."""
        return build(self.furniture, self.people)

    @cached_property
    def fixture_of(self) -> dict[str, Fixture]:
        """The fixture by its name, and by the names of its parts."""
        found = dict(self.fixtures.by_name)
        found |= {thing: fixture for thing, (fixture, _) in self.fixtures.carriers.items()}
        return found | {thing: fixture for thing, (fixture, _) in self.fixtures.movers.items()}

    def surface(self, name: str) -> Surface:
        """What things stand on, on a piece of furniture that is no container."""
        fixture, carrier = self.fixtures.carriers[name]
        x, y, z = fixture.point_m(carrier.center_m)
        return Surface(
            surface=name,
            x_m=x,
            y_m=y,
            z_m=z,
            yaw_rad=fixture.yaw_rad,
            length_m=carrier.size_m[0],
            width_m=carrier.size_m[1],
        )

    def surfaces(self, place: str | None = None) -> tuple[Surface, ...]:
        """The open tops of furniture (in one place), in the order of the file."""
        return tuple(
            self.surface(name)
            for name, (fixture, carrier) in self.fixtures.carriers.items()
            if not (carrier.inside or carrier.roofed)
            and fixture.name in self.furniture
            and (place is None or place in self.places_around(self.furniture[fixture.name].place))
        )

    def starts_open(self, thing: str) -> bool:
        """Whether what opens is open at the start."""
        return self.states.get(thing, {}).get(IS_OPEN) is True

    def start_point_m(self, object: str) -> tuple[float, float, float]:
        """Where the centre of an object's base is at the start."""
        entry = self.object_entries[object]
        x, y = entry.at_m
        if entry.carrier == FLOOR:
            return (x, y, 0.0)
        if entry.carrier in self.object_entries:
            below = self.kind_of(entry.carrier)
            level = FLOOR_M if below.hollow else below.extent_m[2]
            a, b, c = self.start_point_m(entry.carrier)
            yaw = self.start_yaw_rad(entry.carrier)
            turned = (math.cos(yaw) * x - math.sin(yaw) * y, math.sin(yaw) * x + math.cos(yaw) * y)
            return (a + turned[0], b + turned[1], c + level)
        opening = 1.0 if self.starts_open(entry.carrier) else 0.0
        return self.fixtures.carrier_point_m(entry.carrier, x, y, opening)

    def start_yaw_rad(self, object: str) -> float:
        """How an object is turned at the start."""
        entry = self.object_entries[object]
        yaw = math.radians(entry.yaw_deg)
        if entry.carrier in self.object_entries:
            return yaw + self.start_yaw_rad(entry.carrier)
        fixture = self.fixture_of.get(entry.carrier)
        return yaw if fixture is None else yaw + fixture.yaw_rad
