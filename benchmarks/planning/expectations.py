"""What must really be so: short phrases about the simulated world, and whether they hold in it.

The phrases are the suite's own, so that a planner that misreads a sentence is not its own referee.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from math import dist

from keyexpr_schema.payloads.motions import Senses
from keyexpr_schema.payloads.simulation import Truth
from keyexpr_schema.payloads.world import Place
from sim.errors import BadFile

GRID_M = 0.5
SEEN_SHARE = 0.9
"""Part of a room's floor that must have been in a camera's range for it to be looked over."""

_FORMS: tuple[tuple[str, re.Pattern[str]], ...] = (
    ("in", re.compile(r"^(?P<who>.+) in (?P<what>.+)$")),
    ("carried", re.compile(r"^(?P<who>.+) on board (?P<what>\w+)$")),
    ("held", re.compile(r"^(?P<who>.+) held by (?P<what>.+)$")),
    ("seen", re.compile(r"^(?P<what>\w+) looked over$")),
    ("known", re.compile(r"^(?P<who>.+) found$")),
)


@dataclass(frozen=True)
class Expectation:
    """One phrase. Of several in `subjects` (and, for `held`, `values`) one is enough.

    `in`: an object lies in a place, on furniture, the floor or in the basket of a robot there; or a
    robot stands there. `carried`: it is in that robot's basket. `held`: a hand has it. `seen`: all
    of a place was in some camera's range. `known`: the fleet knows where it really is.
    """

    form: str
    subjects: tuple[str, ...]
    values: tuple[str, ...]
    text: str


def parse_expectation(text: str, names: Collection[str], where: str) -> Expectation:
    """A phrase such as `red_cup or blue_cup in kitchen`, `kitchen looked over`.

    Raises:
        BadFile: it has none of the forms, or names what does not exist.
    """
    for form, pattern in _FORMS:
        if match := pattern.match(text):
            groups = match.groupdict()
            subjects = tuple((groups.get("who") or "").split(" or ")) if "who" in groups else ()
            values = tuple((groups.get("what") or "").split(" or ")) if "what" in groups else ()
            for name in (*subjects, *values):
                if name not in names:
                    raise BadFile(f"{where}: {text!r}: there is nothing called {name!r}")
            return Expectation(form, subjects, values, text)
    raise BadFile(
        f"{where}: {text!r} must look like `cup in kitchen`, `cup on board robot`, "
        "`cup held by robot`, `kitchen looked over` or `cup found`"
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

    def satisfies(self, expected: Expectation) -> bool:
        """Whether the phrase holds now."""
        if expected.form == "seen":
            return self._looked_over(expected.values[0])
        return any(self._holds(expected, subject) for subject in expected.subjects)

    def place_of(self, thing: str) -> str | None:
        """The place where an object lies, in a basket or not; `None` in a hand or nowhere."""
        there = self.objects.get(thing)
        return None if there is None or there.held_by is not None else there.place

    def _holds(self, expected: Expectation, subject: str) -> bool:
        if expected.form == "in":
            if subject in self.robots:
                return self.robots[subject].place in expected.values
            return self.place_of(subject) in expected.values
        there = self.objects.get(subject)
        if there is None:
            return False
        if expected.form == "carried":
            return there.support in expected.values
        if expected.form == "held":
            return there.held_by in expected.values
        return self.believed.get(subject) in self._whereabouts(there)

    def _whereabouts(self, there: Truth) -> tuple[str, ...]:
        """What may be said of where an object is: its place, or the robot that has it."""
        holder = there.held_by or (there.support if there.support in self.robots else None)
        return (holder,) if holder is not None else (there.place or "",)

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
