"""What is where in a world without physics, and what the ends of motions do to it."""

from __future__ import annotations

import math

from keyexpr_schema.facts import IS_ON, IS_OPEN
from keyexpr_schema.payloads.motions import (
    Detection,
    Motion,
    MotionKind,
    PointM,
)
from keyexpr_schema.payloads.simulation import Truth
from sim.files.world_schema import FLOOR
from sim.kinematic.whereabouts import REACH_M, KinematicRobot, Whereabouts

MISS_M = 0.15
"""A hand that closes further than this from the object closes on nothing."""


class KinematicState(Whereabouts):
    """Robots, objects and states, and what the ends of motions do to them."""

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
            return self._into_basket(me, motion)
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
        kept = self._kept_from(me, motion.object)
        if kept is not None:
            return kept
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
        kept = self._kept_from(me, target)
        if kept is not None:
            return kept
        there = self.contents(target)
        room = self.things[target].room
        if room is not None and len(there) >= room:
            return f"there is no room at {target}: {', '.join(there)} is there"
        point = self.thing_point(target, time_s)
        if math.dist(point[:2], me.pose[:2]) > self.reach_m(point):
            return f"{target} is out of reach: drive up to it first"
        thing = self.objects[me.holding]
        thing.offset_m, thing.support, me.holding = self.slot(target, there), target, None
        return None

    def _kept_from(self, me: KinematicRobot, thing: str) -> str | None:
        """Why a hand does not get to a thing wherever it is; `None` if it does."""
        shut = self.shut_in(thing)
        if shut is not None:
            return f"{thing} is in {shut}, which is closed: open it first"
        me.blocked_by = self.in_the_way(thing)
        if me.blocked_by is None:
            return None
        return f"{me.blocked_by}, which is open, is in the way of {thing}"

    def _root_name(self, thing: str) -> str:
        return self.root(self.objects[thing]).name if thing in self.objects else thing

    def _look(self, me: KinematicRobot, time_s: float) -> tuple[Detection, ...]:
        place = self.world.place_at(*me.pose[:2])

        def see(name: str, kind: str, point: PointM, support: str) -> None:
            if math.dist(point[:2], me.pose[:2]) > me.capabilities.get(
                "see", 0.0
            ) or not self._in_sight(place, self.world.place_at(*point[:2])):
                return
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

        found: list[Detection] = []
        for thing in self.objects.values():
            hidden = self.shut_in(thing.name) or self.in_the_way(thing.name)
            if self.held_by(self.root(thing)) is None and hidden is None:
                see(thing.name, thing.kind, self.point(thing, time_s), thing.support)
        for name in self.noticed:
            point = self.world.fixtures.face_m(name, self.opening(name))
            see(name, self.things[name].kind, point, FLOOR)
        return tuple(found)

    def _in_sight(self, place: str | None, other: str | None) -> bool:
        """Whether one sees from one place into another: from a room into its parts, and back."""
        around, others = self.world.places_around(place), self.world.places_around(other)
        return place == other or place in others or other in around

    def _grasp(self, me: KinematicRobot, motion: Motion, time_s: float) -> str | None:
        assert motion.object is not None and motion.point_m is not None
        thing = self.objects[motion.object]
        payload_kg = me.capabilities.get("grip")
        holder = self.held_by(thing)
        if payload_kg is None:
            return f"{me.name} has no hand"
        if me.holding is not None:
            return f"the hand already holds {me.holding}"
        if thing.mass_kg > payload_kg:
            return f"{thing.name} is too heavy: {thing.mass_kg:g} kg of at most {payload_kg:g} kg"
        kept = self._kept_from(me, thing.name)
        if kept is not None:
            return kept
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
        support = self.support_at(motion.point_m, me.holding, time_s)
        if support is None:
            return "there is nothing at that point to put it on"
        thing = self.objects[me.holding]
        thing.support, thing.offset_m = support
        me.holding = None
        return None

    def _into_basket(self, me: KinematicRobot, motion: Motion) -> str | None:
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

    def truths(self, time_s: float) -> tuple[Truth, ...]:
        """Where every object really is, and how everything is that has states."""
        found = []
        for thing in self.objects.values():
            point, root = self.point(thing, time_s), self.root(thing)
            holder = self.held_by(root)
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
