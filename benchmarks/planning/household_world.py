"""A kinematic world in which robots also work with tools, and carry bulky things together.

What may be done is judged here by what is so, and by nothing that a planner's skill file says.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable

from keyexpr_schema.facts import IS_ON, IS_OPEN, Value
from keyexpr_schema.payloads.motions import Motion, MotionKind
from sim.files.world_schema import FLOOR
from sim.kinematic.backend import KinematicBackend
from sim.kinematic.state import KinematicState
from sim.kinematic.whereabouts import KinematicRobot

FULL = 3
"""Glasses of water that a jug holds."""
BESIDE_M = 0.5
"""A bulky thing is set down so far before the robot that carried it."""

Deed = Callable[[KinematicState, KinematicRobot], str | None]
"""What a piece of work comes to when it ends; a sentence if it comes to nothing."""


class HouseholdWorld(KinematicBackend):
    """A kinematic world with work of a robot's own making besides motions."""

    def __init__(self, *args: object, **options: object) -> None:
        super().__init__(*args, **options)  # type: ignore[arg-type]
        self._work: dict[str, Deed] = {}

    def begin_work(self, robot: str, takes_s: float, deed: Deed) -> None:
        """Be at work for a while; what that does to the world happens at its end."""
        self.begin(robot, Motion(kind=MotionKind.STOW))
        me = self._state.robots[robot]
        self._count += 1
        me.number, me.ends_s = self._count, self.time_s + takes_s
        self._work[robot] = deed
        heapq.heappush(self._events, (me.ends_s, me.number, robot))

    def state_of(self, subject: str, state: str) -> Value:
        """How a thing or a place really is."""
        return self._state.states.get(subject, state)

    def put(self, thing: str, carrier: str) -> None:
        """Somebody else puts a thing elsewhere; what a robot holds or carries stays."""
        moved = self._state.objects[thing]
        if self._state.held_by(moved) is None and moved.support not in self._state.robots:
            moved.offset_m = self._state.slot(carrier, self._state.contents(carrier))
            moved.support = carrier

    def _begin(self, robot: str, motion: Motion) -> None:
        self._work.pop(robot, None)
        super()._begin(robot, motion)

    def _finish(self, me: KinematicRobot) -> None:
        deed = self._work.pop(me.name, None)
        if deed is None:
            super()._finish(me)
        else:
            self._end(me, me.failure or deed(self._state, me))


def waiting(state: KinematicState, me: KinematicRobot) -> str | None:
    """Time passes, and no more."""
    return None


def slicing(thing: str) -> Deed:
    """Food that lies on a board is cut by who has a knife in the hand."""

    def deed(state: KinematicState, me: KinematicRobot) -> str | None:
        if _held_kind(state, me) != "knife":
            return f"{me.name} has no knife in its hand"
        below = state.objects[thing].support
        if below not in state.objects or state.objects[below].kind != "cutting_board":
            return f"{thing} is on no board"
        return _out_of_reach(state, me, thing) or _set(state, thing, "sliced", True)

    return deed


def mopping(place: str) -> Deed:
    """The floor on which one stands with a mop."""

    def deed(state: KinematicState, me: KinematicRobot) -> str | None:
        if _held_kind(state, me) != "mop":
            return f"{me.name} has no mop in its hand"
        if state.world.place_at(*me.pose[:2]) != place:
            return f"{me.name} is not in {place}"
        return _set(state, place, "mopped", True)

    return deed


def filling(sink: str) -> Deed:
    """The jug in the hand under a running tap."""

    def deed(state: KinematicState, me: KinematicRobot) -> str | None:
        if _held_kind(state, me) != "jug" or me.holding is None:
            return f"{me.name} has no jug in its hand"
        if state.states.get(sink, IS_ON) is not True:
            return f"no water runs in {sink}"
        return _out_of_reach(state, me, sink) or _set(state, me.holding, "level", FULL)

    return deed


def pouring(target: str, becomes: str) -> Deed:
    """From the jug in the hand into a glass, or over a plant."""

    def deed(state: KinematicState, me: KinematicRobot) -> str | None:
        if _held_kind(state, me) != "jug" or me.holding is None:
            return f"{me.name} has no jug in its hand"
        level = state.states.get(me.holding, "level")
        if not isinstance(level, int | float) or level < 1:
            return f"{me.holding} is empty"
        if (shut := state.shut_in(target)) is not None:
            return f"{target} is in {shut}, which is closed"
        wrong = _out_of_reach(state, me, target)
        if wrong is None:
            _set(state, me.holding, "level", level - 1)
            _set(state, target, becomes, True)
        return wrong

    return deed


def lifting(thing: str, partner: str) -> Deed:
    """Two empty pairs of hands at a bulky thing: from now on it goes with the first of them."""

    def deed(state: KinematicState, me: KinematicRobot) -> str | None:
        other = state.robots[partner]
        for robot in (me, other):
            if robot.holding is not None:
                return f"{robot.name} has no hand free: it holds {robot.holding}"
            point = state.thing_point(thing, 0.0)
            if state.world.place_at(*robot.pose[:2]) != state.world.place_at(*point[:2]):
                return f"{robot.name} is not where {thing} is"
        me.holding = other.holding = thing
        state.objects[thing].support = ""
        return None

    return deed


def lowering(thing: str, partner: str) -> Deed:
    """Both let go of it at once, in the place where both of them are."""

    def deed(state: KinematicState, me: KinematicRobot) -> str | None:
        other = state.robots[partner]
        if me.holding != thing or other.holding != thing:
            return f"{me.name} and {partner} do not both have {thing} in their hands"
        if state.world.place_at(*me.pose[:2]) != state.world.place_at(*other.pose[:2]):
            return f"{partner} is not where {me.name} is"
        x, y, yaw = me.pose
        ahead = (x + BESIDE_M * math.cos(yaw), y + BESIDE_M * math.sin(yaw))
        at = ahead if state.world.place_at(*ahead) == state.world.place_at(x, y) else (x, y)
        state.objects[thing].support, state.objects[thing].offset_m = FLOOR, at
        me.holding = other.holding = None
        return None

    return deed


def serving(table: str) -> Deed:
    """Three dishes on the table make a dinner."""

    def deed(state: KinematicState, me: KinematicRobot) -> str | None:
        dishes = [n for n in state.contents(table) if state.things[n].is_a("dish")]
        if len(dishes) < 3:
            return f"{len(dishes)} dishes are on {table}, and not 3"
        return _set(state, table, "served", True)

    return deed


def locking_up(place: str) -> Deed:
    """By whom everything is closed and switched off."""

    def deed(state: KinematicState, me: KinematicRobot) -> str | None:
        for thing in state.things:
            for relation in (IS_OPEN, IS_ON):
                if state.states.get(thing, relation) is True:
                    return f"{relation}({thing}) is true"
        return _set(state, place, "locked_up", True)

    return deed


def _held_kind(state: KinematicState, me: KinematicRobot) -> str | None:
    return None if me.holding is None else state.objects[me.holding].kind


def _out_of_reach(state: KinematicState, me: KinematicRobot, thing: str) -> str | None:
    point = state.thing_point(thing, 0.0)
    near = math.dist(point[:2], me.pose[:2]) <= state.reach_m(point)
    return None if near else f"{thing} is out of reach: drive up to it first"


def _set(state: KinematicState, subject: str, name: str, value: Value) -> str | None:
    state.states.set(subject, name, value)
    return None
