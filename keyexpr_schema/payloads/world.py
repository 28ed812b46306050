"""Payloads about the world: facts, statements, places, objects.

Lengths are metres in the world frame (x east, y north, z up), angles radians.
"""

from __future__ import annotations

from math import cos, hypot, sin

from keyexpr_schema.facts import FactKey, Literal, Value
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload


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


class PlaceAddress(Address, frozen=True):
    """One place."""

    place: str


class ObjectAddress(Address, frozen=True):
    """One object."""

    object: str


class Fact(Payload, frozen=True, kw_only=True):
    """One state variable and its value, with who said so and when.

    `at(x)` is a place; for a thing that a robot has in its hand or basket it is that robot.
    `holding(robot)` is an object or `nothing`.
    `time_s` is seconds on the fleet's clock (simulated time in a simulation).
    """

    subject: Id
    relation: Id
    value: Value
    source: str
    time_s: float = 0.0

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
    said again is news, and its facts are believed as of then.
    """

    statement: Id
    text: str
    source: str = "person"
    said_s: float = 0.0


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


class Place(Payload, frozen=True, kw_only=True):
    """A region of the floor with a name.

    `region_m` is a list of axis-aligned rectangles `(x_min, y_min, x_max, y_max)`.
    `travel_m` gives the driven distance from here to other places.
    """

    place: Id
    label: str
    aliases: tuple[str, ...] = ()
    region_m: tuple[tuple[float, float, float, float], ...] = ()
    surfaces: tuple[Surface, ...] = ()
    travel_m: dict[str, float] = {}

    def contains(self, x_m: float, y_m: float) -> bool:
        """Whether the point lies in the region, borders included."""
        return any(a <= x_m <= c and b <= y_m <= d for a, b, c, d in self.region_m)


class Object(Payload, frozen=True, kw_only=True):
    """A thing that can be spoken about. `ordinal` counts within a kind: cup 1 is the first cup.

    `categories` are nouns for more than its kind ("dish"), `uses` verbs for what it is good for
    ("drink": it is "something to drink"). `home` is the place where it belongs, for those who tidy
    up.
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
