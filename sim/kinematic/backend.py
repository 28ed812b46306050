"""`KinematicBackend`: a world without physics that jumps from event to event.

The same motions with the same meaning as in the physical world, each taking a known or a drawn
time. Robots pass through each other. It is for studying many robots, and what goes wrong.
"""

from __future__ import annotations

import heapq
import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.motions import (
    Motion,
    MotionKind,
    MotionOutcome,
    MotionState,
    PointM,
    Senses,
)
from keyexpr_schema.payloads.robots import PoseMRad, RobotSpec
from keyexpr_schema.payloads.simulation import ContactCount, Frame, Scene, Truth
from sim.backend import Backend
from sim.batteries import Use
from sim.files.world_schema import WorldFile
from sim.kinematic.scene import draw_frame, draw_scene
from sim.kinematic.state import STATE_OF, KinematicState
from sim.kinematic.whereabouts import REACH_M, KinematicObject, KinematicRobot
from sim.navigation.routes import Route, Routes
from sim.states import ThingStates

DRIVES = frozenset(
    {
        MotionKind.GO_TO,
        MotionKind.APPROACH,
        MotionKind.PLACE_AT,
        MotionKind.HAND_OVER,
        MotionKind.CHARGE,
        *STATE_OF,
    }
)
"""Motions that drive up to where they are done."""


@dataclass(frozen=True)
class MotionModel:
    """How long motions take, and which of them fail.

    Driving takes the route's length over the robot's `drive` speed; the rest takes the seconds
    given here. Each is multiplied by a factor drawn from a lognormal distribution with median 1 and
    `spread` as the standard deviation of its logarithm; 0 draws nothing. `failure_chance` gives a
    probability by kind of motion; `failures` names motions that fail for certain, counted from 1
    for each robot and kind: `{"hsr": {"grasp": (1, 2)}}`.
    """

    look_s: float = 2.0
    grasp_s: float = 6.0
    release_s: float = 5.0
    stow_s: float = 2.0
    open_s: float = 12.0
    switch_s: float = 4.0
    settle_s: float = 0.5
    """Added to every drive, for turning and braking."""
    spread: float = 0.0
    failure_chance: dict[str, float] = field(default_factory=dict)
    failures: dict[str, dict[str, tuple[int, ...]]] = field(default_factory=dict)

    def handling_s(self, kind: MotionKind) -> float:
        """Of a motion that is not a drive."""
        return {
            MotionKind.LOOK: self.look_s,
            MotionKind.GRASP: self.grasp_s,
            MotionKind.STOW: self.stow_s,
            MotionKind.OPEN: self.open_s,
            MotionKind.CLOSE: self.open_s,
            MotionKind.SWITCH_ON: self.switch_s,
            MotionKind.SWITCH_OFF: self.switch_s,
        }.get(kind, self.release_s)


class KinematicBackend(Backend):
    """See the module. `step_s` bounds how far one `advance` goes; `None` is to the next event."""

    def __init__(
        self,
        world: WorldFile,
        robots: Sequence[tuple[RobotSpec, PoseMRad]],
        motion_model: MotionModel | None = None,
        seed: int = 0,
        step_s: float | None = None,
        charge: Mapping[str, float] = {},
    ) -> None:
        super().__init__(world, [spec for spec, _ in robots], charge)
        self._motion_model = motion_model or MotionModel()
        self._step_s = step_s
        self._routes = Routes(world)
        self._events: list[tuple[float, int, str]] = []
        self._count = 0
        # A generator for each robot: what one draws does not depend on when others ask.
        states = {
            spec.robot: KinematicRobot(
                spec.robot,
                spec.model,
                dict(spec.capabilities),
                start,
                random.Random(f"{seed}/{spec.robot}"),
                self._routes.nearest(start),
            )
            for spec, start in robots
        }
        objects = {}
        for name, entry in world.object_entries.items():
            mass_kg = world.kind_of(name).mass_kg
            objects[name] = KinematicObject(name, entry.kind, mass_kg, entry.at_m, entry.carrier)
        self._state = KinematicState(world, self.things, states, objects, ThingStates(world))

    def advance(self) -> None:
        self._advance()
        self._state.states.advance(self.time_s, self._state.contents)

    def _advance(self) -> None:
        while self._events and self._stale(self._events[0]):
            heapq.heappop(self._events)
        lasts_s = self.batteries.lasts_s(self._use)
        step_s = self._step_s or (lasts_s if self._events else 0.05)
        horizon = self.time_s + min(step_s, lasts_s)
        if not self._events or self._events[0][0] > horizon:
            self._pass_until(horizon)
            return
        self._pass_until(self._events[0][0])
        # Everything that happens at this instant happens, so that nobody sees half of it.
        while self._events and self._events[0][0] <= self.time_s:
            event = heapq.heappop(self._events)
            if not self._stale(event):
                self._state.states.advance(self.time_s, self._state.contents)
                self._finish(self._state.robots[event[2]])

    def _use(self, robot: str) -> Use:
        me = self._state.robots[robot]
        if me.state is not MotionState.RUNNING:
            return Use.IDLE
        if me.docked_at is not None:
            return Use.CHARGING
        return Use.WORKING if me.route is None else Use.DRIVING

    def _charges_at(self, robot: str) -> str | None:
        me = self._state.robots[robot]
        return me.docked_at if me.state is MotionState.RUNNING else None

    def _dock(self, me: KinematicRobot, motion: Motion, charger: str) -> None:
        """Begin to charge, until the battery is full."""
        if (taken := self._taken(charger, me.name)) is not None:
            self._end(me, taken)
            return
        battery, charge = self.batteries.battery(me.name), self.batteries.charge(me.name)
        assert battery is not None and charge is not None
        me.pose, me.route, me.docked_at = self._state.pose(me, self.time_s), None, charger
        takes_s = battery.charging_s(charge)
        left_s = me.begun_s + motion.timeout_s - self.time_s
        if takes_s > left_s:
            takes_s, me.failure = left_s, f"it took longer than {motion.timeout_s:g} s"
        me.ends_s = self.time_s + takes_s
        heapq.heappush(self._events, (me.ends_s, me.number, me.name))

    def _stale(self, event: tuple[float, int, str]) -> bool:
        robot = self._state.robots[event[2]]
        return robot.number != event[1] or robot.state is not MotionState.RUNNING

    def _begin(self, robot: str, motion: Motion) -> None:
        me = self._state.robots[robot]
        self._count += 1
        me.motion, me.number, me.seen = motion, self._count, ()
        me.state, me.reason, me.failure, me.route = MotionState.RUNNING, None, None, None
        me.blocked_by, me.hopeless, me.docked_at = None, False, None
        me.begun_s = self.time_s
        nth = me.counts[motion.kind] = me.counts.get(motion.kind, 0) + 1
        kind = motion.kind.value
        scripted = self._motion_model.failures.get(robot, {}).get(kind, ())
        unlucky = me.chance.random() < self._motion_model.failure_chance.get(kind, 0.0)
        factor = math.exp(me.chance.gauss(0.0, self._motion_model.spread))
        takes_s = self._motion_model.handling_s(motion.kind)
        if motion.kind in DRIVES and "drive" not in me.capabilities:
            me.failure = self._out_of_reach(me, motion)
            me.hopeless = me.failure is not None
        elif motion.kind in DRIVES:
            me.route = self._route(me, motion)
            if me.route is None:
                self._end(me, self._no_way(me, motion))
                return
            me.node = me.route.node
            takes_s = self._drive_s(me, me.route, motion.kind)
        if nth in scripted or unlucky:
            me.failure = _MISHAPS.get(motion.kind, "something was in the way")
        takes_s *= factor
        if takes_s > motion.timeout_s:
            takes_s, me.failure = motion.timeout_s, f"it took longer than {motion.timeout_s:g} s"
        me.ends_s = self.time_s + takes_s
        heapq.heappush(self._events, (me.ends_s, self._count, robot))

    def close(self, closures: Sequence[Closure]) -> None:
        self._routes.close(closures)
        for name, me in self._state.robots.items():
            if me.state is not MotionState.RUNNING or me.route is None or me.motion is None:
                continue
            me.pose = self._state.pose(me, self.time_s)
            me.route = self._route(me, me.motion)
            if me.route is None:
                self._end(me, self._no_way(me, me.motion))
                continue
            self._count += 1
            me.number, me.node, me.begun_s = self._count, me.route.node, self.time_s
            me.ends_s = self.time_s + self._drive_s(me, me.route, me.motion.kind)
            heapq.heappush(self._events, (me.ends_s, self._count, name))

    def _drive_s(self, me: KinematicRobot, route: Route, kind: MotionKind) -> float:
        takes_s = route.length_m / me.capabilities["drive"] + self._motion_model.settle_s
        if kind not in (MotionKind.GO_TO, MotionKind.APPROACH, MotionKind.CHARGE):
            takes_s += self._motion_model.handling_s(kind)
        return takes_s

    def _no_way(self, me: KinematicRobot, motion: Motion) -> str:
        to = motion.place or motion.point_m or motion.object
        closed = "; ".join(map(str, self._routes.closed_to(me.model)))
        return f"there is no way to {to} from here" + (f": {closed}" if closed else "")

    def _stop(self, robot: str) -> None:
        me = self._state.robots[robot]
        if me.state is MotionState.RUNNING:
            me.pose = self._state.pose(me, self.time_s)
            me.node = self._routes.nearest(me.pose)
            me.state, me.reason, me.route = MotionState.STOPPED, "it was told to stop", None

    def _end(self, me: KinematicRobot, failure: str | None) -> None:
        me.pose, me.route = self._state.pose(me, self.time_s), None
        me.reason = failure
        me.state = MotionState.SUCCEEDED if failure is None else MotionState.FAILED

    def _finish(self, me: KinematicRobot) -> None:
        assert me.motion is not None
        if me.failure is not None:
            self._end(me, me.failure)
            return
        if me.motion.kind is MotionKind.CHARGE and me.docked_at is None:
            assert me.motion.object is not None
            self._dock(me, me.motion, me.motion.object)
            return
        me.pose = self._state.pose(me, self.time_s)
        self._end(me, self._state.effect(me, me.motion, self.time_s))

    def _out_of_reach(self, me: KinematicRobot, motion: Motion) -> str | None:
        """Why a robot that does not drive cannot do it from where it stands."""
        if motion.kind is MotionKind.GO_TO:
            here = self.world.places_around(self.world.place_at(*me.pose[:2]))
            return None if motion.place in here else f"{me.name} does not drive"
        point = self._point(motion)
        if math.dist(point[:2], me.pose[:2]) <= self._state.reach_m(point):
            return None
        return f"{me.name} does not drive, and ({point[0]:.2f}, {point[1]:.2f}) is out of its reach"

    def _point(self, motion: Motion) -> PointM:
        """Where a motion is done that drives up to something."""
        point = motion.point_m
        if motion.kind is MotionKind.CHARGE:
            fixture = self.world.fixtures.by_name[str(motion.object)]
            assert fixture.dock_m is not None
            return fixture.point_m(fixture.dock_m)
        if motion.kind is not MotionKind.APPROACH:
            assert motion.object is not None
            point = self._state.thing_point(motion.object, self.time_s)
        assert point is not None
        return point

    def _works_in(self, me: KinematicRobot, place: str) -> KinematicRobot | None:
        """Another robot that does not drive, with a hand, and stands in a place."""
        others = (other for other in self._state.robots.values() if other is not me)
        arms = (o for o in others if "grip" in o.capabilities and "drive" not in o.capabilities)
        return next((arm for arm in arms if self.world.place_at(*arm.pose[:2]) == place), None)

    def _route(self, me: KinematicRobot, motion: Motion) -> Route | None:
        if motion.place is not None and motion.kind is MotionKind.GO_TO:
            host = self._works_in(me, motion.place)
            if host is not None:  # who comes to it stops where its hand gets to
                return self._routes.to_point(me.pose, host.pose, REACH_M, me.model)
            taken = {other.node for other in self._state.robots.values() if other is not me}
            return self._routes.to_place(me.pose, motion.place, taken, me.model)
        point = self._point(motion)
        return self._routes.to_point(me.pose, point, self._state.reach_m(point), me.model)

    def _stands(self, robot: str) -> bool:
        return not self._runs_still(robot)

    def _runs_still(self, robot: str) -> bool:
        return self._state.robots[robot].state is MotionState.RUNNING

    def _outcome(self, robot: str) -> MotionOutcome | None:
        me = self._state.robots[robot]
        if me.state is None:
            return None
        return MotionOutcome(
            state=me.state,
            senses=self._senses(robot),
            reason=me.reason,
            detections=me.seen,
            blocked_by=me.blocked_by,
            retryable=not me.hopeless,
        )

    def _senses(self, robot: str) -> Senses:
        me = self._state.robots[robot]
        pose = self._state.pose(me, self.time_s)
        return Senses(
            robot=robot,
            time_s=self.time_s,
            pose_m_rad=pose,
            place=self.world.place_at(*pose[:2]),
            holding=me.holding,
            basket=tuple(me.basket),
            basket_sensor=True,
            moving=me.route is not None,
            charge=self.batteries.charge(robot),
        )

    def truths(self) -> tuple[Truth, ...]:
        return self._state.truths(self.time_s)

    def contacts(self) -> ContactCount:
        return ContactCount(time_s=self.time_s, robot_robot=0, robot_wall=0)

    def scene(self) -> Scene:
        return draw_scene(self.world, self.robots)

    def frame(self) -> Frame:
        state, now_s = self._state, self.time_s
        return draw_frame(
            now_s,
            {name: state.pose(robot, now_s) for name, robot in state.robots.items()},
            {name: state.point(thing, now_s) for name, thing in state.objects.items()},
            self.world.fixtures,
            state.opening,
        )


_MISHAPS = {
    MotionKind.GRASP: "the object slipped out of the hand",
    MotionKind.RELEASE: "the hand could not get to the point",
    MotionKind.RELEASE_IN_BASKET: "the basket was not where it should be",
    MotionKind.LOOK: "the camera gave no picture",
    MotionKind.STOW: "the arm got stuck",
    MotionKind.PLACE_AT: "the hand could not get there",
    MotionKind.HAND_OVER: "it was not taken",
    MotionKind.OPEN: "the handle slipped out of the hand",
    MotionKind.CLOSE: "the handle slipped out of the hand",
    MotionKind.SWITCH_ON: "the finger missed the switch",
    MotionKind.SWITCH_OFF: "the finger missed the switch",
    MotionKind.CHARGE: "the contacts of the charger were not met",
}
