"""What is where in a world without physics, and what the ends of motions do to it."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from keyexpr_schema.facts import IS_ON, IS_OPEN
from keyexpr_schema.payloads.motions import (
    Detection,
    Motion,
    MotionKind,
    MotionState,
    PointM,
)
from keyexpr_schema.payloads.robots import PoseMRad
from keyexpr_schema.payloads.simulation import Truth
from keyexpr_schema.payloads.world import Object
from sim.files.world_schema import FLOOR, FLOOR_M, WorldFile
from sim.navigation.routes import Route
from sim.states import ThingStates

REACH_M = 1.2
"""How far from a robot's centre its hand gets, sideways; generous, as stances here are coarse."""

REACH_IN_M = 2.0
"""The same at furniture whose doors and drawers take up the floor before it."""

SLOT_M = 0.12
"""Things that are set down side by side are so far apart."""

MISS_M = 0.15
"""A hand that closes further than this from the object closes on nothing."""


@dataclass
class KinematicRobot:
    """A robot, its latest motion, and the route it drives on while that runs."""

    name: str
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
class KinematicState:
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

    def _held_by(self, thing: KinematicObject) -> str | None:
        return next((r.name for r in self.robots.values() if r.holding == thing.name), None)

    def point(self, thing: KinematicObject, time_s: float) -> PointM:
        """Where an object is: on the floor, or where what carries it is."""
        holder = self._held_by(thing)
        carrier = holder or (thing.support if thing.support in self.robots else None)
        if carrier is not None:
            x, y, _ = self.pose(self.robots[carrier], time_s)
            return (x, y, 0.8 if holder else 0.3)
        if thing.support == FLOOR:
            return (*thing.offset_m, 0.0)
        return self._point_at(thing.support, thing.offset_m, time_s)

    def _point_at(self, carrier: str, offset_m: tuple[float, float], time_s: float) -> PointM:
        """A point on or in a thing, given from its middle."""
        if carrier in self.world.fixtures.carriers:
            return self.world.fixtures.carrier_point_m(carrier, *offset_m, self._opening(carrier))
        x, y, z = self.point(self.objects[carrier], time_s)
        kind = self.world.kind_of(carrier)
        level = FLOOR_M if kind.hollow else kind.extent_m[2]
        return (x + offset_m[0], y + offset_m[1], z + level)

    def _opening(self, thing: str) -> float:
        return 1.0 if self.states.get(thing, IS_OPEN) is True else 0.0

    def thing_point(self, thing: str, time_s: float) -> PointM:
        """Where a thing is, the middle of its base; of what is opened or switched, where a hand
        does that."""
        if thing in self.objects:
            return self.point(self.objects[thing], time_s)
        fixtures = self.world.fixtures
        if thing in fixtures.movers:
            fixture, mover = fixtures.movers[thing]
            return fixtures.moved_m(thing, mover.handle_m, self._opening(thing))
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

    def _shut_in(self, thing: str) -> str | None:
        """The closed thing that a thing is in, however indirectly."""
        while thing in self.objects:
            thing = self.objects[thing].support
            if self.states.get(thing, IS_OPEN) is False:
                return thing
        return None

    def _root(self, thing: KinematicObject) -> KinematicObject:
        """The object that carries it, and whatever carries that, up to one that no object does."""
        while thing.support in self.objects:
            thing = self.objects[thing.support]
        return thing

    def effect(self, me: KinematicRobot, motion: Motion, time_s: float) -> str | None:
        """Carry out the end of `motion`; why not, if it cannot be."""
        kind = motion.kind
        if kind is MotionKind.LOOK:
            me.seen = self._look(me, time_s)
        elif kind is MotionKind.GRASP:
            return self._grasp(me, motion, time_s)
        elif kind is MotionKind.RELEASE:
            return self._release(me, motion, time_s)
        elif kind is MotionKind.RELEASE_IN_BASKET:
            return self._hand_over(me, motion)
        elif kind in (MotionKind.PLACE_AT, MotionKind.HAND_OVER):
            return self._place_at(me, motion, time_s)
        elif kind in STATE_OF:
            return self._change(me, motion, time_s)
        return None

    def _change(self, me: KinematicRobot, motion: Motion, time_s: float) -> str | None:
        """Open, close or switch something."""
        assert motion.object is not None
        state, value = STATE_OF[motion.kind]
        if self.states.get(motion.object, state) == value:
            return None
        if me.capabilities.get("grip") is None:
            return f"{me.name} has no hand"
        if me.holding is not None:
            return f"the hand is not empty: it holds {me.holding}"
        point = self.thing_point(motion.object, time_s)
        if math.dist(point[:2], me.pose[:2]) > self.reach_m(point):
            return f"{motion.object} is out of reach: drive up to it first"
        self.states.set(motion.object, state, value)
        return None

    def _place_at(self, me: KinematicRobot, motion: Motion, time_s: float) -> str | None:
        """Set what is held down on or in a thing, or give it to a person."""
        target = motion.object
        assert target is not None
        if me.holding is None:
            return "the hand is empty"
        if target == me.holding or self._root_name(target) == me.holding:
            return f"{me.holding} cannot be put on or in itself"
        if self.states.get(target, IS_OPEN) is False:
            return f"{target} is closed: open it first"
        shut = self._shut_in(target)
        if shut is not None:
            return f"{target} is in {shut}, which is closed: open it first"
        there = self.contents(target)
        room = self.things[target].room
        if room is not None and len(there) >= room:
            return f"there is no room at {target}: {', '.join(there)} is there"
        point = self.thing_point(target, time_s)
        if math.dist(point[:2], me.pose[:2]) > self.reach_m(point):
            return f"{target} is out of reach: drive up to it first"
        thing = self.objects[me.holding]
        thing.offset_m, thing.support, me.holding = self._slot(target, there), target, None
        return None

    def _root_name(self, thing: str) -> str:
        return self._root(self.objects[thing]).name if thing in self.objects else thing

    def _slot(self, carrier: str, there: list[str]) -> tuple[float, float]:
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

    def _look(self, me: KinematicRobot, time_s: float) -> tuple[Detection, ...]:
        place = self.world.place_at(*me.pose[:2])

        def seen(name: str, kind: str, point: PointM, support: str) -> bool:
            if (
                math.dist(point[:2], me.pose[:2]) > me.capabilities.get("see", 0.0)
                or self.world.place_at(*point[:2]) != place
            ):
                return False
            found.append(
                Detection(
                    object=name,
                    kind=kind,
                    point_m=point,
                    place=place,
                    support=support,
                    states=self.states.of(name),
                )
            )
            return True

        found: list[Detection] = []
        for thing in self.objects.values():
            if self._held_by(self._root(thing)) is None and self._shut_in(thing.name) is None:
                seen(thing.name, thing.kind, self.point(thing, time_s), thing.support)
        for name in self.noticed:
            x, y = self.world.fixture_of[name].center_m
            seen(name, self.things[name].kind, (x, y, 0.0), FLOOR)
        return tuple(found)

    @cached_property
    def noticed(self) -> tuple[str, ...]:
        """Furniture that has states, and people."""
        fixtures = self.world.fixtures
        return tuple(
            name
            for name in self.things
            if name in fixtures.movers or name in fixtures.buttons or name in self.world.people
        )

    def _grasp(self, me: KinematicRobot, motion: Motion, time_s: float) -> str | None:
        assert motion.object is not None and motion.point_m is not None
        thing = self.objects[motion.object]
        payload_kg = me.capabilities.get("grip")
        holder = self._held_by(thing)
        if payload_kg is None:
            return f"{me.name} has no hand"
        if me.holding is not None:
            return f"the hand already holds {me.holding}"
        if thing.mass_kg > payload_kg:
            return f"{thing.name} is too heavy: {thing.mass_kg:g} kg of at most {payload_kg:g} kg"
        shut = self._shut_in(thing.name)
        if shut is not None:
            return f"{thing.name} is in {shut}, which is closed: open it first"
        point = self.point(thing, time_s)
        if holder is not None or math.dist(point, motion.point_m) > MISS_M:
            return f"{thing.name} is not there; the hand closed on nothing"
        if math.dist(point[:2], me.pose[:2]) > self.reach_m(point):
            return f"{thing.name} is out of reach: drive up to it first"
        if thing.support in self.robots:
            self.robots[thing.support].basket.remove(thing.name)
        me.holding, thing.support = thing.name, ""
        return None

    def _release(self, me: KinematicRobot, motion: Motion, time_s: float) -> str | None:
        assert motion.point_m is not None
        if me.holding is None:
            return "the hand is empty"
        if math.dist(motion.point_m[:2], me.pose[:2]) > self.reach_m(motion.point_m):
            return "the point is out of reach: drive up to it first"
        support = self._support_at(motion.point_m, me.holding, time_s)
        if support is None:
            return "there is nothing at that point to put it on"
        thing = self.objects[me.holding]
        thing.support, thing.offset_m = support
        me.holding = None
        return None

    def _hand_over(self, me: KinematicRobot, motion: Motion) -> str | None:
        assert motion.robot is not None
        other = self.robots[motion.robot]
        room = other.capabilities.get("basket", 0.0)
        if me.holding is None:
            return "the hand is empty"
        if room <= 0:
            return f"{other.name} has no basket"
        if len(other.basket) >= room:
            return f"the basket of {other.name} is full"
        if math.dist(other.pose[:2], me.pose[:2]) > REACH_M or other.route is not None:
            return f"{other.name} is out of reach or moving"
        self.objects[me.holding].support = other.name
        other.basket.append(me.holding)
        me.holding = None
        return None

    def _support_at(
        self, point_m: PointM, held: str, time_s: float
    ) -> tuple[str, tuple[float, float]] | None:
        """What a thing that is let go at a point lies on, and where on that."""
        x, y, z = point_m
        blocked = False
        for name, (fixture, carrier) in self.world.fixtures.carriers.items():
            if self.states.get(name, IS_OPEN) is False:
                continue
            middle = self.world.fixtures.carrier_point_m(name, 0.0, 0.0, self._opening(name))
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
            px, py, pz = self._point_at(other.name, (0.0, 0.0), time_s)
            if math.dist((x, y), (px, py)) <= max(kind.extent_m[:2]) / 2 and abs(z - pz) <= 0.1:
                return other.name, (x - px, y - py)
        if blocked or abs(z) > 0.1 or self.world.place_at(x, y) is None:
            return None
        return FLOOR, (x, y)

    def truths(self, time_s: float) -> tuple[Truth, ...]:
        """Where every object really is, and how everything is that has states."""
        found = []
        for thing in self.objects.values():
            point, root = self.point(thing, time_s), self._root(thing)
            holder = self._held_by(root)
            carrier = self.robots.get(holder or root.support)
            found.append(
                Truth(
                    object=thing.name,
                    kind=thing.kind,
                    time_s=time_s,
                    point_m=point,
                    place=self.world.place_at(*point[:2]),
                    support=thing.support or None,
                    held_by=holder if root is thing else None,
                    settled=holder is None and (carrier is None or carrier.route is None),
                    states=self.states.of(thing.name),
                )
            )
        for name in self.noticed:
            x, y = self.world.fixture_of[name].center_m
            found.append(
                Truth(
                    object=name,
                    kind=self.things[name].kind,
                    time_s=time_s,
                    point_m=(x, y, 0.0),
                    place=self.world.place_at(x, y),
                    support=FLOOR,
                    held_by=None,
                    settled=True,
                    states=self.states.of(name),
                )
            )
        return tuple(found)


STATE_OF: dict[MotionKind, tuple[str, bool]] = {
    MotionKind.OPEN: (IS_OPEN, True),
    MotionKind.CLOSE: (IS_OPEN, False),
    MotionKind.SWITCH_ON: (IS_ON, True),
    MotionKind.SWITCH_OFF: (IS_ON, False),
}
"""The state that a motion brings about."""
