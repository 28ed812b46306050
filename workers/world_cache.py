"""What a worker knows of the world, from keys: places, objects, facts, other robots."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from keyexpr_schema.facts import AT, BLOCKED_BY, IS_OPEN, FactKey, Value
from keyexpr_schema.keyspace import FACT, OBJECT, PLACE, ROBOT_SPEC, ROBOT_STATE
from keyexpr_schema.payloads.motions import Detection
from keyexpr_schema.payloads.robots import RobotSpec, RobotState
from keyexpr_schema.payloads.world import Fact, Feature, Object, Place
from keyexpr_schema.transport.session import Change
from workers.host_clock import running_s

FLOOR = "floor"
WORLD_KEYS = (PLACE, OBJECT, FACT, ROBOT_SPEC, ROBOT_STATE)
"""The keys that `WorldCache.apply` takes changes of."""


class WorldCache:
    """The latest value of each key, kept up to date by `apply`."""

    def __init__(self) -> None:
        self.places: dict[str, Place] = {}
        self.objects: dict[str, Object] = {}
        self.robots: dict[str, RobotState] = {}
        self.specs: dict[str, RobotSpec] = {}
        self.facts: dict[FactKey, Fact] = {}
        self.heard_s: dict[FactKey, float] = {}
        """When facts were heard here, by `running_s`."""
        self._changed = asyncio.Event()

    def apply(self, change: Change[Any, Any]) -> None:
        """Take over one change of one of `WORLD_KEYS`."""
        address, value = change.address, change.value
        if change.key is PLACE:
            _put(self.places, address.place, value)
        elif change.key is OBJECT:
            _put(self.objects, address.object, value)
        elif change.key is FACT:
            _put(self.facts, address.key, value)
            _put(self.heard_s, address.key, None if value is None else running_s())
        elif change.key is ROBOT_SPEC:
            _put(self.specs, address.robot, value)
        elif change.key is ROBOT_STATE:
            _put(self.robots, address.robot, value)
        self._changed.set()
        self._changed = asyncio.Event()

    async def until(self, condition: Callable[[], bool], timeout_s: float | None = None) -> bool:
        """Wait until `condition` holds, looking again at every change; whether it came to hold.

        `timeout_s` is wall time (`None`: for ever): what is waited for are messages of others.
        """
        try:
            async with asyncio.timeout(timeout_s):
                while not condition():
                    await self._changed.wait()
        except TimeoutError:
            return False
        return True

    def value_of(self, relation: str, subject: str) -> Value:
        """The value of the fact `relation(subject)`; `None` if it is unknown."""
        fact = self.facts.get(FactKey(relation, subject))
        return None if fact is None else fact.value

    def objects_at(self, place: str) -> tuple[str, ...]:
        """The known objects of which the facts say that they are at `place`, sorted."""
        return tuple(sorted(o for o in self.objects if self.value_of(AT, o) == place))

    def visible_in(self, place: str) -> tuple[str, ...]:
        """The objects that should be seen in a place: by the facts they are there, in nothing that
        is closed and in no robot's hand or basket."""
        return tuple(
            sorted(
                name
                for name in self.objects
                if self.moves(name)
                and self.within(self.place_of(_word(self.value_of(AT, name))), place)
                and not any(self.closed(c) or self.blocked(c) for c in self.carriers(name))
            )
        )

    def moves(self, thing: str) -> bool:
        """Whether a thing's whereabouts are to be observed: of furniture they are known."""
        found = self.objects.get(thing)
        return found is None or found.movable or found.is_a(Feature.PERSON)

    def carriers(self, thing: str) -> tuple[str, ...]:
        """What carries a thing, by the facts: directly first, and the wholes of parts."""
        found: list[str] = []
        at: str | None = thing
        while at is not None and at in self.objects and at not in found[:-1]:
            about = self.objects[at]
            known = _word(self.value_of(AT, at))
            at = about.part_of or known or (None if about.movable else about.home)
            if at is not None:
                found.append(at)
        return tuple(found)

    def closed(self, thing: str) -> bool:
        """Whether a thing opens, and is not known to be open."""
        about = self.objects.get(thing)
        opens = about is not None and about.is_a(Feature.OPENABLE)
        return opens and self.value_of(IS_OPEN, thing) is not True

    def blocked(self, thing: str) -> bool:
        """Whether something that is open is in the way of a thing and of what is in it."""
        about = self.objects.get(thing)
        others = (*(about.blocked_by if about else ()), self.value_of(BLOCKED_BY, thing))
        return any(isinstance(o, str) and self.value_of(IS_OPEN, o) is True for o in others)

    def place_of(self, where: str | None) -> str | None:
        """The place where something is that is at `where`: a place, or a thing in one. A robot's
        basket is where it is; `None`: unknown."""
        if where is None or where in self.places or where in self.specs:
            return where
        found = self.carriers(where)
        return found[-1] if found and found[-1] in {*self.places, *self.specs} else None

    def within(self, place: str | None, whole: str) -> bool:
        """Whether a place is `whole`, or a part of it."""
        return place is not None and whole in self._around(place)

    def _around(self, place: str) -> tuple[str, ...]:
        found = [place]
        while (about := self.places.get(found[-1])) is not None and about.part_of is not None:
            if about.part_of in found:
                break
            found.append(about.part_of)
        return tuple(found)

    def whereabouts(self, seen: Detection) -> str | None:
        """The value of `at(object)` that a detection shows.

        That is the thing that it is on or in, else the place where it lies on floor or furniture,
        or the robot in whose basket it lies; `None` if the detection does not show it (in a hand,
        outside all places).
        """
        if seen.support in self.objects:
            return seen.support
        if seen.support == FLOOR:
            if seen.place is not None:
                return seen.place
            x_m, y_m, _ = seen.point_m
            found = [p.place for p in self.places.values() if p.contains(x_m, y_m)]
            return max(found, key=lambda place: len(self._around(place)), default=None)
        for place in self.places.values():
            if any(surface.surface == seen.support for surface in place.surfaces):
                return place.place
        return seen.support if seen.support in self.specs else None


def _word(value: Value) -> str | None:
    return value if isinstance(value, str) else None


def _put(table: dict[Any, Any], name: object, value: object | None) -> None:
    if value is None:
        table.pop(name, None)
    else:
        table[name] = value
