"""What is where in a world without physics, and what the ends of motions do to it."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

from keyexpr_schema.payloads.motions import (
    Detection,
    Motion,
    MotionKind,
    MotionState,
    PointM,
)
from keyexpr_schema.payloads.robots import PoseMRad
from keyexpr_schema.payloads.simulation import Truth
from sim.files.world_schema import FLOOR, WorldFile
from sim.navigation.routes import Route

REACH_M = 1.2
"""How far from a robot's centre its hand gets, sideways; generous, as stances here are coarse."""

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
    """An object. `support` is a surface, `floor`, a robot (its basket), or nothing: in a hand."""

    name: str
    kind: str
    mass_kg: float
    point_m: PointM
    support: str


@dataclass
class KinematicState:
    """Robots and objects, by name. Times are simulated seconds."""

    world: WorldFile
    robots: dict[str, KinematicRobot]
    objects: dict[str, KinematicObject]

    def pose(self, me: KinematicRobot, time_s: float) -> PoseMRad:
        """Where a robot is, on its route or at its end."""
        if me.route is None or me.state is not MotionState.RUNNING:
            return me.pose
        whole = me.ends_s - me.begun_s
        return me.route.at(min(1.0, (time_s - me.begun_s) / whole) if whole > 0 else 1.0)

    def _held_by(self, thing: KinematicObject) -> str | None:
        return next((r.name for r in self.robots.values() if r.holding == thing.name), None)

    def point(self, thing: KinematicObject, time_s: float) -> PointM:
        """Where an object is: its own place, or where who carries it is."""
        carrier = self._held_by(thing) or (thing.support if thing.support in self.robots else None)
        if carrier is None:
            return thing.point_m
        x, y, _ = self.pose(self.robots[carrier], time_s)
        return (x, y, 0.8 if thing.support == "" else 0.3)

    def effect(self, me: KinematicRobot, motion: Motion, time_s: float) -> str | None:
        """Carry out the end of `motion`; why not, if it cannot be."""
        if motion.kind is MotionKind.LOOK:
            me.seen = self._look(me, time_s)
        elif motion.kind is MotionKind.GRASP:
            return self._grasp(me, motion, time_s)
        elif motion.kind is MotionKind.RELEASE:
            return self._release(me, motion)
        elif motion.kind is MotionKind.RELEASE_IN_BASKET:
            return self._hand_over(me, motion)
        return None

    def _look(self, me: KinematicRobot, time_s: float) -> tuple[Detection, ...]:
        place = self.world.place_at(*me.pose[:2])
        found = []
        for thing in self.objects.values():
            point = self.point(thing, time_s)
            near = math.dist(point[:2], me.pose[:2]) <= me.capabilities.get("see", 0.0)
            here = self.world.place_at(*point[:2]) == place
            if near and here and self._held_by(thing) is None:
                found.append(
                    Detection(
                        object=thing.name,
                        kind=thing.kind,
                        point_m=point,
                        place=place,
                        support=thing.support,
                    )
                )
        return tuple(found)

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
        point = self.point(thing, time_s)
        if holder is not None or math.dist(point, motion.point_m) > MISS_M:
            return f"{thing.name} is not there; the hand closed on nothing"
        if math.dist(point[:2], me.pose[:2]) > REACH_M:
            return f"{thing.name} is out of reach: drive up to it first"
        if thing.support in self.robots:
            self.robots[thing.support].basket.remove(thing.name)
        me.holding, thing.support = thing.name, ""
        return None

    def _release(self, me: KinematicRobot, motion: Motion) -> str | None:
        assert motion.point_m is not None
        if me.holding is None:
            return "the hand is empty"
        if math.dist(motion.point_m[:2], me.pose[:2]) > REACH_M:
            return "the point is out of reach: drive up to it first"
        support = self._support_at(motion.point_m)
        if support is None:
            return "there is nothing at that point to put it on"
        thing = self.objects[me.holding]
        thing.point_m, thing.support, me.holding = motion.point_m, support, None
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

    def _support_at(self, point_m: PointM) -> str | None:
        x, y, z = point_m
        for top in self.world.surfaces():
            if top.distance_m(x, y) == 0.0:
                return top.surface if abs(z - top.z_m) <= 0.1 else None
        return FLOOR if abs(z) <= 0.1 and self.world.place_at(x, y) is not None else None

    def truths(self, time_s: float) -> tuple[Truth, ...]:
        """Where every object really is, in the order of the world file."""
        found = []
        for thing in self.objects.values():
            point, holder = self.point(thing, time_s), self._held_by(thing)
            carrier = self.robots.get(holder or thing.support)
            found.append(
                Truth(
                    object=thing.name,
                    kind=thing.kind,
                    time_s=time_s,
                    point_m=point,
                    place=self.world.place_at(*point[:2]),
                    support=thing.support or None,
                    held_by=holder,
                    settled=holder is None and (carrier is None or carrier.route is None),
                )
            )
        return tuple(found)
