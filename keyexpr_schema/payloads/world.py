"""Payloads about the world: facts, statements, places, objects.

Lengths are metres in the world frame (x east, y north, z up), angles radians.
"""

from __future__ import annotations

from enum import Enum
from math import cos, hypot, sin

from keyexpr_schema.authors import Author, Source
from keyexpr_schema.facts import FactKey, Literal, Value
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, NamedAddress, Payload


class FactAddress(Address, frozen=True):
    """The key of one fact."""

    subject: str
    relation: str

    @classmethod
    def of(cls, key: FactKey) -> FactAddress:
        """Where the fact about this variable stands."""
        return cls(subject=key.subject, relation=key.relation)

    @property
    def key(self) -> FactKey:
        """The variable that the fact there is about."""
        return FactKey(self.relation, self.subject)


class StatementAddress(Address, frozen=True):
    """One statement."""

    statement: str


class PlaceAddress(NamedAddress, frozen=True):
    """One place."""

    place: str


class ObjectAddress(NamedAddress, frozen=True):
    """One object."""

    object: str


PERSON_SOURCE = "person"
"""`source` of facts that people say."""


class Fact(Payload, frozen=True, kw_only=True):
    """One state variable and its value, with who said so and when.

    `at(x)` is what carries x directly: a place, a thing that it is on or in, the robot that has it
    in its hand or basket, the person who has it. `on(x)` and `in(x)` a thing say the same.
    `holding(robot)` is an object or `nothing`.
    `time_s` is seconds on the fleet's clock (simulated time in a simulation).
    """

    subject: Id
    relation: Id
    value: Value
    source: Source
    time_s: float = 0.0
    by: Author = ""
    """Of what people say: who it was, such as `ana@lab`."""

    @classmethod
    def of(cls, literal: Literal, source: str, time_s: float = 0.0) -> Fact:
        """The fact that a literal holds."""
        (relation, subject), value = literal
        return cls(subject=subject, relation=relation, value=value, source=source, time_s=time_s)

    @property
    def key(self) -> FactKey:
        """The variable that it is about."""
        return FactKey(self.relation, self.subject)

    @property
    def literal(self) -> Literal:
        """What it says: variable and value."""
        return Literal(self.key, self.value)


class Statement(Payload, frozen=True, kw_only=True):
    """A sentence about the world, kept as it was written.

    `said_s` is when it was said, on the fleet's clock [s]; 0: it does not say. The same sentence
    said again is news, and its facts are believed as of then. `speaker` is the person who says it:
    "I" in the text.
    """

    statement: Id
    text: str
    source: Source = "person"
    said_s: float = 0.0
    speaker: Id | None = None
    by: Author = ""
    """Who put it there, such as `ana@lab`."""


class StatementStatus(Payload, frozen=True, kw_only=True):
    """What the planner read out of a statement: facts, or why none; `said_s` is the statement's."""

    statement: Id
    facts: tuple[Fact, ...] = ()
    reason: str | None = None
    said_s: float = 0.0


class Surface(Payload, frozen=True, kw_only=True):
    """A flat, level area on which things can be put down; axis-aligned in its own yaw."""

    surface: Id
    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    length_m: float
    width_m: float

    def point_m(self, along_m: float, across_m: float) -> tuple[float, float, float]:
        """A point on it in the world frame, given from its middle along its own axes."""
        c, s = cos(self.yaw_rad), sin(self.yaw_rad)
        return (
            self.x_m + c * along_m - s * across_m,
            self.y_m + s * along_m + c * across_m,
            self.z_m,
        )

    def distance_m(self, x_m: float, y_m: float) -> float:
        """From a point to it on the floor plan; 0 on, over and under it."""
        c, s = cos(self.yaw_rad), sin(self.yaw_rad)
        dx, dy = x_m - self.x_m, y_m - self.y_m
        along = max(0.0, abs(c * dx + s * dy) - self.length_m / 2)
        return hypot(along, max(0.0, abs(c * dy - s * dx) - self.width_m / 2))


class Way(Payload, frozen=True, kw_only=True):
    """A way to drive to a place: `length_m`, and the places, doors and zones that it passes, its
    ends not among them."""

    to: Id
    length_m: float
    through: tuple[Id, ...] = ()


class Place(Payload, frozen=True, kw_only=True):
    """A region of the floor with a name.

    `region_m` is a list of axis-aligned rectangles `(x_min, y_min, x_max, y_max)`.
    `travel_m` gives the driven distance from here to other places, and `ways` how one gets there:
    the shortest way, and through each door into the next place. `part_of` is the place that it
    lies in: a corner of a room, a room of a flat.
    """

    place: Id
    label: str
    aliases: tuple[str, ...] = ()
    region_m: tuple[tuple[float, float, float, float], ...] = ()
    surfaces: tuple[Surface, ...] = ()
    travel_m: dict[str, float] = {}
    ways: tuple[Way, ...] = ()
    part_of: Id | None = None
    by: Author = ""
    """Who put it there, such as `ana@lab`."""

    def contains(self, x_m: float, y_m: float) -> bool:
        """Whether the point lies in the region, borders included."""
        return any(a <= x_m <= c and b <= y_m <= d for a, b, c, d in self.region_m)


class Feature(str, Enum):
    """What can be done with a thing. World files may use any other word besides these."""

    MOVABLE = "movable"
    """It can be taken up and carried."""
    SUPPORTS = "supports"
    """Things can be on it."""
    CONTAINS = "contains"
    """Things can be in it."""
    OPENABLE = "openable"
    """It opens and closes; what is in it can be seen and reached only while it is open."""
    SWITCHABLE = "switchable"
    """It is switched on and off."""
    PERSON = "person"
    """Somebody whom things can be given to; what is at a person is in that person's hand."""


class Object(Payload, frozen=True, kw_only=True):
    """A thing that can be spoken about: cups, but also furniture, appliances, trays and people.
    `ordinal` counts within a kind: cup 1 is the first cup.

    `categories` are nouns for more than its kind ("dish"), `uses` verbs for what it is good for
    ("drink": it is "something to drink"). `home` is the place where it belongs, for those who tidy
    up. `features` (`Feature`, or any other word) say what can be done with it. `part_of` is the
    thing that it is a fixed part of, as a drawer is of its cabinet. `room` is how many things there
    can be on it or in it at once (`None`: no limit). `properties` are numbers and words that skill
    files may compare, e.g. `size_l`. `blocked_by` are things that, while they are open, are in the
    way of hands at it and at what is on or in it: of a drawer, those above it.
    """

    object: Id
    kind: Id
    label: str
    ordinal: int = 1
    aliases: tuple[str, ...] = ()
    mass_kg: float = 0.0
    movable: bool = True
    home: Id | None = None
    categories: tuple[str, ...] = ()
    uses: tuple[str, ...] = ()
    features: tuple[str, ...] = ()
    part_of: Id | None = None
    room: float | None = None
    properties: dict[str, Value] = {}
    blocked_by: tuple[Id, ...] = ()
    by: Author = ""
    """Who put it there, such as `ana@lab`."""

    def is_a(self, word: str) -> bool:
        """Whether a kind, category or feature is true of it. A person, or a fixed part of another
        thing, is never `movable`."""
        if word == Feature.MOVABLE:
            return self.movable and self.part_of is None and not self.is_a(Feature.PERSON)
        return word == self.kind or word in self.features or word in self.categories


class ClaimAddress(Address, frozen=True):
    """What is claimed: a number of goals or of a kind of objects, or a name in the world."""

    of: str
    name: str


class Claim(Payload, frozen=True, kw_only=True):
    """What somebody is about to give a name or a number to, and when they said so (Unix seconds).

    `number`: the last that was given out; `kind`: what the name is for.
    """

    wall_time_s: float
    number: int = 0
    kind: str = ""
