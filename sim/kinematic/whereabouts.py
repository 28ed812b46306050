"""Where robots and things are in a world without physics, and what carries them."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from keyexpr_schema.facts import IS_OPEN
from keyexpr_schema.payloads.motions import Detection, Motion, MotionKind, MotionState, PointM
from keyexpr_schema.payloads.robots import PoseMRad
from keyexpr_schema.payloads.world import Object
from sim.files.world_schema import FLOOR, FLOOR_M, WorldFile
from sim.navigation.routes import Route
from sim.states import ThingStates

REACH_M = 1.2
"""How far from a robot's centre its hand gets, sideways; generous, as stances here are coarse."""

REACH_IN_M = 2.4
"""The same at furniture whose doors and drawers take up the floor before it."""

SLOT_M = 0.12
"""Things that are set down side by side are so far apart."""


@dataclass
class KinematicRobot:
    """A robot, its latest motion, and the route it drives on while that runs."""

    name: str
    model: str
    capabilities: dict[str, float]
    pose: PoseMRad
    chance: random.Random
    node: int
    """Of the lattice: where it stands or is going."""
    holding: str | None = None
    basket: list[str] = field(default_factory=list)
    counts: dict[MotionKind, int] = field(default_factory=dict)
    motion: Motion | None = None
    number: int = 0
    begun_s: float = 0.0
    ends_s: float = 0.0
    route: Route | None = None
    failure: str | None = None
    state: MotionState | None = None
    reason: str | None = None
    seen: tuple[Detection, ...] = ()
    blocked_by: str | None = None
    hopeless: bool = False
    docked_at: str | None = None
    """The charger at which it charges, while its motion runs."""


@dataclass
class KinematicObject:
    """An object. `support` is what carries it directly: `floor`, a thing, a person, a robot (its
    basket), or nothing: in a hand. `offset_m` (x, y) counts from the middle of that, on the floor
    from the world's origin.
    """

    name: str
    kind: str
    mass_kg: float
    offset_m: tuple[float, float]
    support: str


@dataclass
class Whereabouts:
    """Robots and objects, by name. Times are simulated seconds."""

    world: WorldFile
    things: Mapping[str, Object]
    robots: dict[str, KinematicRobot]
    objects: dict[str, KinematicObject]
    states: ThingStates

    def pose(self, me: KinematicRobot, time_s: float) -> PoseMRad:
        """Where a robot is, on its route or at its end."""
        if me.route is None or me.state is not MotionState.RUNNING:
            return me.pose
        whole = me.ends_s - me.begun_s
        return me.route.at(min(1.0, (time_s - me.begun_s) / whole) if whole > 0 else 1.0)

    def held_by(self, thing: KinematicObject) -> str | None:
        return next((r.name for r in self.robots.values() if r.holding == thing.name), None)

    def point(self, thing: KinematicObject, time_s: float) -> PointM:
        """Where an object is: on the floor, or where what carries it is."""
        holder = self.held_by(thing)
        carrier = holder or (thing.support if thing.support in self.robots else None)
        if carrier is not None:
            x, y, _ = self.pose(self.robots[carrier], time_s)
            return (x, y, 0.8 if holder else 0.3)
        if thing.support == FLOOR:
            return (*thing.offset_m, 0.0)
        return self.point_at(thing.support, thing.offset_m, time_s)

    def point_at(self, carrier: str, offset_m: tuple[float, float], time_s: float) -> PointM:
        """A point on or in a thing, given from its middle."""
        if carrier in self.world.fixtures.carriers:
            return self.world.fixtures.carrier_point_m(carrier, *offset_m, self.opening(carrier))
        x, y, z = self.point(self.objects[carrier], time_s)
        kind = self.world.kind_of(carrier)
        level = FLOOR_M if kind.hollow else kind.extent_m[2]
        return (x + offset_m[0], y + offset_m[1], z + level)

    def opening(self, thing: str) -> float:
        """How far something is open, 0 or 1."""
        return 1.0 if self.states.get(thing, IS_OPEN) is True else 0.0

    def thing_point(self, thing: str, time_s: float) -> PointM:
        """Where a thing is, the middle of its base; of what is opened or switched, where a hand
        does that."""
        if thing in self.objects:
            return self.point(self.objects[thing], time_s)
        fixtures = self.world.fixtures
        if thing in fixtures.movers:
            fixture, mover = fixtures.movers[thing]
            return fixtures.moved_m(thing, mover.handle_m, self.opening(thing))
        if thing in fixtures.buttons:
            fixture, button = fixtures.buttons[thing]
            return fixture.point_m(button.top_m)
        if thing in fixtures.carriers:
            return fixtures.carrier_point_m(thing, 0.0, 0.0)
        return (*self.world.fixture_of[thing].center_m, 0.0)

    def reach_m(self, point_m: PointM) -> float:
        """How far from a point a robot can stand and still do something there."""
        for fixture in self.world.fixtures.by_name.values():
            x, y, _ = fixture.local_m(point_m)
            beyond = fixture.front_m if y < 0.0 else 0.0
            if abs(x) <= fixture.half_m[0] + beyond and abs(y) <= fixture.half_m[1] + beyond:
                return REACH_IN_M
        return REACH_M

    def contents(self, carrier: str) -> list[str]:
        """What is directly on or in a thing."""
        return [thing.name for thing in self.objects.values() if thing.support == carrier]

    def shut_in(self, thing: str) -> str | None:
        """The closed thing that a thing is in, however indirectly."""
        while thing in self.objects:
            thing = self.objects[thing].support
            if self.states.get(thing, IS_OPEN) is False:
                return thing
        return None

    def in_the_way(self, thing: str) -> str | None:
        """What is open, and keeps hands from a thing or from what it is on or in."""
        while True:
            others = self.things[thing].blocked_by if thing in self.things else ()
            for other in others:
                if self.states.get(other, IS_OPEN) is True:
                    return other
            if thing not in self.objects:
                return None
            thing = self.objects[thing].support

    def root(self, thing: KinematicObject) -> KinematicObject:
        """The object that carries it, and whatever carries that, up to one that no object does."""
        while thing.support in self.objects:
            thing = self.objects[thing.support]
        return thing

    def slot(self, carrier: str, there: list[str]) -> tuple[float, float]:
        """Where on a carrier the next thing comes: as far from the others as `SLOT_M` allows."""
        if carrier in self.world.fixtures.carriers:
            length, width, _ = self.world.fixtures.carriers[carrier][1].size_m
        else:
            length, width, _ = self.world.kind_of(carrier).extent_m
        columns = max(1, int(length / SLOT_M))
        rows = max(1, int(width / SLOT_M))
        taken = [self.objects[name].offset_m for name in there]
        slots = [
            (length * ((c + 0.5) / columns - 0.5), width * ((r + 0.5) / rows - 0.5))
            for r in range(rows)
            for c in range(columns)
        ]
        free = [s for s in slots if all(math.dist(s, at) >= SLOT_M / 2 for at in taken)]
        return (free or slots)[0]

    def support_at(
        self, point_m: PointM, held: str, time_s: float
    ) -> tuple[str, tuple[float, float]] | None:
        """What a thing that is let go at a point lies on, and where on that."""
        x, y, z = point_m
        blocked = False
        for name, (fixture, carrier) in self.world.fixtures.carriers.items():
            if self.states.get(name, IS_OPEN) is False:
                continue
            middle = self.world.fixtures.carrier_point_m(name, 0.0, 0.0, self.opening(name))
            a, b, _ = fixture.local_m(point_m)
            c, d, _ = fixture.local_m(middle)
            off = (a - c, b - d)
            if abs(off[0]) <= carrier.size_m[0] / 2 and abs(off[1]) <= carrier.size_m[1] / 2:
                if abs(z - middle[2]) <= 0.1:
                    return name, off
                blocked = True
        for other in self.objects.values():
            kind = self.world.kind_of(other.name)
            if other.name == held or not kind.carries:
                continue
            px, py, pz = self.point_at(other.name, (0.0, 0.0), time_s)
            if math.dist((x, y), (px, py)) <= max(kind.extent_m[:2]) / 2 and abs(z - pz) <= 0.1:
                return other.name, (x - px, y - py)
        if blocked or abs(z) > 0.1 or self.world.place_at(x, y) is None:
            return None
        return FLOOR, (x, y)

    @cached_property
    def noticed(self) -> tuple[str, ...]:
        """Furniture that has states, and people."""
        fixtures = self.world.fixtures
        return tuple(
            name
            for name in self.things
            if name in fixtures.movers or name in fixtures.buttons or name in self.world.people
        )
