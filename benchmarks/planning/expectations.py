"""What must really be so: short phrases about the simulated world, and whether they hold in it.

The phrases are the suite's own, so that a planner that misreads a sentence is not its own referee.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from math import dist

from keyexpr_schema.facts import parse_value
from keyexpr_schema.payloads.motions import Senses
from keyexpr_schema.payloads.simulation import Truth
from keyexpr_schema.payloads.world import Place
from sim.errors import BadFile

GRID_M = 0.5
SEEN_SHARE = 0.9
"""Part of a room's floor that must have been in a camera's range for it to be looked over."""

_FORMS: tuple[tuple[str, re.Pattern[str]], ...] = (
    ("state", re.compile(r"^(?P<state>\w+)\((?P<who>.+)\) is (?P<value>.+)$")),
    ("some", re.compile(r"^(?P<count>\d+) of (?P<who>.+) in (?P<what>.+)$")),
    ("in", re.compile(r"^(?P<who>.+) in (?P<what>.+)$")),
    ("carried", re.compile(r"^(?P<who>.+) on board (?P<what>\w+)$")),
    ("held", re.compile(r"^(?P<who>.+) held by (?P<what>.+)$")),
    ("on", re.compile(r"^(?P<who>.+) on (?P<what>.+)$")),
    ("with", re.compile(r"^(?P<who>.+) with (?P<what>.+)$")),
    ("seen", re.compile(r"^(?P<what>\w+) looked over$")),
    ("known", re.compile(r"^(?P<who>.+) found$")),
)


@dataclass(frozen=True)
class Expectation:
    """One phrase. Of several in `subjects` (and, for `held`, `values`) one is enough.

    `in`: an object lies in a place, on furniture, the floor or in the basket of a robot there; or a
    robot stands there; in a thing: that, or a part of it, carries it directly. `on`: the same of
    things to be on. `some`: that many of them are in it. `carried`: it is in that robot's basket.
    `held`: a hand has it. `with`: a person has it. `state`: it is `values[0]`; all of the subjects
    joined by `and`. `seen`: all of a place was in some camera's range. `known`: the fleet knows
    where it really is.
    """

    form: str
    subjects: tuple[str, ...]
    values: tuple[str, ...]
    text: str
    state: str = ""
    count: int = 1


def parse_expectation(text: str, names: Collection[str], where: str) -> Expectation:
    """A phrase such as `red_cup or blue_cup in kitchen`, `kitchen looked over`.

    Raises:
        BadFile: it has none of the forms, or names what does not exist.
    """
    for form, pattern in _FORMS:
        if match := pattern.match(text):
            groups = match.groupdict()
            joint = ", " if form == "some" else " or "
            subjects = tuple((groups.get("who") or "").split(joint)) if "who" in groups else ()
            values = tuple((groups.get("what") or "").split(" or ")) if "what" in groups else ()
            for name in (*subjects, *values):
                if name not in names:
                    raise BadFile(f"{where}: {text!r}: there is nothing called {name!r}")
            if form == "state":
                values = (groups["value"],)
            return Expectation(
                form, subjects, values, text, groups.get("state", ""), int(groups.get("count", 1))
            )
    raise BadFile(
        f"{where}: {text!r} must look like `cup in kitchen`, `cup on table`, `cup on board robot`, "
        "`cup held by robot`, `cup with anna`, `clean(cup) is true`, `2 of cup, mug in box`, "
        "`kitchen looked over` or `cup found`"
    )


@dataclass
class GroundTruth:
    """The simulated world at one moment, and what was ever looked at."""

    objects: Mapping[str, Truth]
    robots: Mapping[str, Senses]
    places: Mapping[str, Place]
    believed: Mapping[str, object] = field(default_factory=dict)
    """Where the fleet believes objects to be."""
    looks: Collection[tuple[str, float, float, float]] = ()
    """Every look so far: place, x [m], y [m], range [m]."""
    parts: Mapping[str, str | None] = field(default_factory=dict)
    """What things are parts of."""
    state_of: Callable[[str, str], object] = lambda subject, state: None
    """How a thing or a place is."""

    def satisfies(self, expected: Expectation) -> bool:
        """Whether the phrase holds now."""
        if expected.form == "seen":
            return self._looked_over(expected.values[0])
        if expected.form == "some":
            there = [s for s in expected.subjects if self._in(s, expected.values)]
            return len(there) >= expected.count
        return any(self._holds(expected, subject) for subject in expected.subjects)

    def place_of(self, thing: str) -> str | None:
        """The place where an object lies, in a basket or not; `None` in a hand or nowhere."""
        there = self.objects.get(thing)
        return None if there is None or there.held_by is not None else there.place

    def _holds(self, expected: Expectation, subject: str) -> bool:
        if expected.form == "in":
            return self._in(subject, expected.values)
        if expected.form == "state":
            value = self.state_of(subject, expected.state)
            return value is not None and value == parse_value(expected.values[0])
        there = self.objects.get(subject)
        if there is None:
            return False
        if expected.form in ("carried", "with"):
            return there.support in expected.values
        if expected.form == "on":
            return self._directly(there, expected.values)
        if expected.form == "held":
            return there.held_by in expected.values
        return self.believed.get(subject) in self._whereabouts(there)

    def _in(self, subject: str, values: Collection[str]) -> bool:
        if subject in self.robots:
            return self.robots[subject].place in values
        there = self.objects.get(subject)
        if there is not None and self._directly(there, values):
            return True
        return self.place_of(subject) in values

    def _directly(self, there: Truth, values: Collection[str]) -> bool:
        """Whether one of them, or a part of one, is what it is on or in."""
        below = there.support
        return below is not None and (below in values or self.parts.get(below) in values)

    def _whereabouts(self, there: Truth) -> tuple[str, ...]:
        """What may be said of where an object is: its place, or the robot that has it."""
        holder = there.held_by or (there.support if there.support in self.robots else None)
        if holder is not None:
            return (holder,)
        return (there.place or "", there.support or "")

    def _looked_over(self, name: str) -> bool:
        looks = [(x, y, see_m) for place, x, y, see_m in self.looks if place == name]
        points = [
            (a + GRID_M * (i + 0.5), b + GRID_M * (j + 0.5))
            for a, b, c, d in self.places[name].region_m
            for i in range(int((c - a) / GRID_M))
            for j in range(int((d - b) / GRID_M))
        ]
        seen = sum(any(dist(p, (x, y)) <= see_m for x, y, see_m in looks) for p in points)
        return seen >= SEEN_SHARE * len(points)
