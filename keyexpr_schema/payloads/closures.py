"""Closures: parts of the floor that robots do not enter, or one at a time."""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum

from keyexpr_schema.authors import Author
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload

Rectangle = tuple[float, float, float, float]
"""`(x_min, y_min, x_max, y_max)`, m, world frame."""


class RegionAddress(Address, frozen=True):
    """One door or zone."""

    region: str


class ClosureAddress(Address, frozen=True):
    """One closure."""

    closure: str


class RegionKind(str, Enum):
    """What a named part of the floor is."""

    DOOR = "door"
    ZONE = "zone"


class Region(Payload, frozen=True, kw_only=True):
    """A door, or a zone that somebody has drawn: a part of the floor that can be closed.

    Places can be, too. `region_m` are rectangles; `between` the places that a door joins.
    """

    region: Id
    kind: RegionKind
    label: str = ""
    region_m: tuple[Rectangle, ...] = ()
    between: tuple[Id, ...] = ()


class Closure(Payload, frozen=True, kw_only=True):
    """While its key is there, and the fleet's clock is before `until_s` [s], no robot enters.

    `names` are the places, doors and zones that are closed, as planning knows them; `region_m` is
    where robots do not drive, as their drivers do. Who is in there may leave. With `models`, it is
    closed for robots of these models only. With `one_at_a_time`, one robot is let in, and the next
    when that has left.
    """

    closure: Id
    names: tuple[Id, ...]
    region_m: tuple[Rectangle, ...] = ()
    models: tuple[Id, ...] = ()
    one_at_a_time: bool = False
    until_s: float | None = None
    by: Author = ""
    reason: str = ""
    wall_time_s: float = 0.0
    """When it was given, Unix time [s]."""

    def is_over(self, time_s: float) -> bool:
        """Whether its time is over, on the fleet's clock [s]."""
        return self.until_s is not None and self.until_s <= time_s

    def is_for(self, model: str) -> bool:
        """Whether robots of this model do not enter."""
        return not self.one_at_a_time and (not self.models or model in self.models)

    def __str__(self) -> str:
        *more, last = self.names or [*map(_rectangle, self.region_m)] or ["a part of the floor"]
        what = f"{', '.join(more)} and {last}" if more else last
        whom = f" for {' and '.join(self.models)}" if self.models else ""
        who = f" by {self.by}" if self.by else ""
        why = f" ({self.reason})" if self.reason else ""
        one = "open to one robot at a time" if self.one_at_a_time else "closed"
        be = "are" if (self.names or self.region_m)[1:] else "is"
        return f"{what} {be} {one}{whom}{who}{why}"


def _rectangle(corners_m: Rectangle) -> str:
    x_min, y_min, x_max, y_max = corners_m
    return f"the floor from ({x_min:g}, {y_min:g}) to ({x_max:g}, {y_max:g}) m"


def shut(closures: Iterable[Closure], model: str) -> tuple[Closure, ...]:
    """Those that robots of a model do not enter."""
    return tuple(closure for closure in closures if closure.is_for(model))
