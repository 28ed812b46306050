"""`KinematicBackend`: a world without physics that jumps from event to event.

The same motions with the same meaning as in the physical world, each taking a known or a drawn
time. Robots pass through each other. It is for studying many robots, and what goes wrong.
"""

from __future__ import annotations

import heapq
import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, field

from keyexpr_schema.payloads.motions import (
    Detection,
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
from sim.files.world_schema import FLOOR, WorldFile
from sim.kinematic.scene import draw_frame, draw_scene
from sim.navigation.routes import Route, Routes

REACH_M = 1.2
"""How far from a robot's centre its hand gets, sideways; generous, as stances here are coarse."""

MISS_M = 0.15
"""A hand that closes further than this from the object closes on nothing."""


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
        }.get(kind, self.release_s)


@dataclass
class _Robot:
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
class _Thing:
    name: str
    kind: str
    mass_kg: float
    point_m: PointM
    support: str


class KinematicBackend(Backend):
    """See the module. `step_s` bounds how far one `advance` goes; `None` is to the next event."""

    def __init__(
        self,
        world: WorldFile,
        robots: Sequence[tuple[RobotSpec, PoseMRad]],
        motion_model: MotionModel | None = None,
        seed: int = 0,
        step_s: float | None = None,
    ) -> None:
        super().__init__(world, tuple(spec.robot for spec, _ in robots))
        self._motion_model = motion_model or MotionModel()
        self._step_s = step_s
        self._routes = Routes(world)
        self._events: list[tuple[float, int, str]] = []
        self._count = 0
        # A generator for each robot: what one draws does not depend on when others ask.
        self._robots = {
            spec.robot: _Robot(
                spec.robot,
                dict(spec.capabilities),
                start,
                random.Random(f"{seed}/{spec.robot}"),
                self._routes.nearest(start),
            )
            for spec, start in robots
        }
        self._things = {
            name: _Thing(
                name,
                entry.kind,
                world.object_kinds[entry.kind].mass_kg,
                world.start_point_m(name),
                entry.on,
            )
            for name, entry in world.object_entries.items()
        }

    # --- time --------------------------------------------------------------------------------

    def _advance(self) -> None:
        while self._events and self._stale(self._events[0]):
            heapq.heappop(self._events)
        horizon = self.time_s + (self._step_s or 0.05)
        if not self._events:
            self.time_s = horizon
            return
        if self._step_s is not None and self._events[0][0] > horizon:
            self.time_s = horizon
            return
        self.time_s = self._events[0][0]
        # Everything that happens at this instant happens, so that nobody sees half of it.
        while self._events and self._events[0][0] <= self.time_s:
            event = heapq.heappop(self._events)
            if not self._stale(event):
                self._finish(self._robots[event[2]])

    def _stale(self, event: tuple[float, int, str]) -> bool:
        robot = self._robots[event[2]]
        return robot.number != event[1] or robot.state is not MotionState.RUNNING

    def _begin(self, robot: str, motion: Motion) -> None:
        me = self._robots[robot]
        self._count += 1
        me.motion, me.number, me.seen = motion, self._count, ()
        me.state, me.reason, me.failure, me.route = MotionState.RUNNING, None, None, None
        me.begun_s = self.time_s
        nth = me.counts[motion.kind] = me.counts.get(motion.kind, 0) + 1
        kind = motion.kind.value
        scripted = self._motion_model.failures.get(robot, {}).get(kind, ())
        unlucky = me.chance.random() < self._motion_model.failure_chance.get(kind, 0.0)
        factor = math.exp(me.chance.gauss(0.0, self._motion_model.spread))
        takes_s = self._motion_model.handling_s(motion.kind)
        if motion.kind in (MotionKind.GO_TO, MotionKind.APPROACH):
            me.route = self._route(me, motion)
            if me.route is None:
                self._end(me, f"there is no way to {motion.place or motion.point_m} from here")
                return
            me.node = me.route.node
            takes_s = me.route.length_m / me.capabilities["drive"] + self._motion_model.settle_s
        if nth in scripted or unlucky:
            me.failure = _MISHAPS.get(motion.kind, "something was in the way")
        takes_s *= factor
        if takes_s > motion.timeout_s:
            takes_s, me.failure = motion.timeout_s, f"it took longer than {motion.timeout_s:g} s"
        me.ends_s = self.time_s + takes_s
        heapq.heappush(self._events, (me.ends_s, self._count, robot))

    def _stop(self, robot: str) -> None:
        me = self._robots[robot]
        if me.state is MotionState.RUNNING:
            me.pose = self._pose(me)
            me.node = self._routes.nearest(me.pose)
            me.state, me.reason, me.route = MotionState.STOPPED, "it was told to stop", None

    def _end(self, me: _Robot, failure: str | None) -> None:
        me.pose, me.route = self._pose(me), None
        me.reason = failure
        me.state = MotionState.SUCCEEDED if failure is None else MotionState.FAILED

    def _finish(self, me: _Robot) -> None:
        assert me.motion is not None
        if me.failure is not None:
            self._end(me, me.failure)
            return
        me.pose = self._pose(me)
        self._end(me, self._effect(me, me.motion))

    # --- what motions do ---------------------------------------------------------------------

    def _route(self, me: _Robot, motion: Motion) -> Route | None:
        if motion.place is not None and motion.kind is MotionKind.GO_TO:
            taken = {other.node for other in self._robots.values() if other is not me}
            return self._routes.to_place(me.pose, motion.place, taken)
        assert motion.point_m is not None
        return self._routes.to_point(me.pose, motion.point_m, REACH_M)

    def _effect(self, me: _Robot, motion: Motion) -> str | None:
        """Carry out the end of `motion`; why not, if it cannot be."""
        if motion.kind is MotionKind.LOOK:
            me.seen = self._look(me)
        elif motion.kind is MotionKind.GRASP:
            return self._grasp(me, motion)
        elif motion.kind is MotionKind.RELEASE:
            return self._release(me, motion)
        elif motion.kind is MotionKind.RELEASE_IN_BASKET:
            return self._hand_over(me, motion)
        return None

    def _look(self, me: _Robot) -> tuple[Detection, ...]:
        place = self.world.place_at(*me.pose[:2])
        found = []
        for thing in self._things.values():
            point = self._point(thing)
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

    def _grasp(self, me: _Robot, motion: Motion) -> str | None:
        assert motion.object is not None and motion.point_m is not None
        thing = self._things[motion.object]
        payload_kg = me.capabilities.get("grip")
        holder = self._held_by(thing)
        if payload_kg is None:
            return f"{me.name} has no hand"
        if me.holding is not None:
            return f"the hand already holds {me.holding}"
        if thing.mass_kg > payload_kg:
            return f"{thing.name} is too heavy: {thing.mass_kg:g} kg of at most {payload_kg:g} kg"
        point = self._point(thing)
        if holder is not None or math.dist(point, motion.point_m) > MISS_M:
            return f"{thing.name} is not there; the hand closed on nothing"
        if math.dist(point[:2], me.pose[:2]) > REACH_M:
            return f"{thing.name} is out of reach: drive up to it first"
        if thing.support in self._robots:
            self._robots[thing.support].basket.remove(thing.name)
        me.holding, thing.support = thing.name, ""
        return None

    def _release(self, me: _Robot, motion: Motion) -> str | None:
        assert motion.point_m is not None
        if me.holding is None:
            return "the hand is empty"
        if math.dist(motion.point_m[:2], me.pose[:2]) > REACH_M:
            return "the point is out of reach: drive up to it first"
        support = self._support_at(motion.point_m)
        if support is None:
            return "there is nothing at that point to put it on"
        thing = self._things[me.holding]
        thing.point_m, thing.support, me.holding = motion.point_m, support, None
        return None

    def _hand_over(self, me: _Robot, motion: Motion) -> str | None:
        assert motion.robot is not None
        other = self._robots[motion.robot]
        room = other.capabilities.get("basket", 0.0)
        if me.holding is None:
            return "the hand is empty"
        if room <= 0:
            return f"{other.name} has no basket"
        if len(other.basket) >= room:
            return f"the basket of {other.name} is full"
        if math.dist(other.pose[:2], me.pose[:2]) > REACH_M or other.route is not None:
            return f"{other.name} is out of reach or moving"
        self._things[me.holding].support = other.name
        other.basket.append(me.holding)
        me.holding = None
        return None

    def _support_at(self, point_m: PointM) -> str | None:
        x, y, z = point_m
        for top in self.world.surfaces():
            c, s = math.cos(top.yaw_rad), math.sin(top.yaw_rad)
            dx, dy = x - top.x_m, y - top.y_m
            inside = abs(c * dx + s * dy) <= top.length_m / 2
            inside &= abs(c * dy - s * dx) <= top.width_m / 2
            if inside:
                return top.surface if abs(z - top.z_m) <= 0.1 else None
        return FLOOR if abs(z) <= 0.1 and self.world.place_at(x, y) is not None else None

    # --- where things are --------------------------------------------------------------------

    def _pose(self, me: _Robot) -> PoseMRad:
        if me.route is None or me.state is not MotionState.RUNNING:
            return me.pose
        whole = me.ends_s - me.begun_s
        return me.route.at(min(1.0, (self.time_s - me.begun_s) / whole) if whole > 0 else 1.0)

    def _held_by(self, thing: _Thing) -> str | None:
        return next((r.name for r in self._robots.values() if r.holding == thing.name), None)

    def _point(self, thing: _Thing) -> PointM:
        carrier = self._held_by(thing) or (thing.support if thing.support in self._robots else None)
        if carrier is None:
            return thing.point_m
        x, y, _ = self._pose(self._robots[carrier])
        return (x, y, 0.8 if thing.support == "" else 0.3)

    def _outcome(self, robot: str) -> MotionOutcome | None:
        me = self._robots[robot]
        if me.state is None:
            return None
        return MotionOutcome(
            state=me.state, senses=self._senses(robot), reason=me.reason, detections=me.seen
        )

    def _senses(self, robot: str) -> Senses:
        me = self._robots[robot]
        pose = self._pose(me)
        return Senses(
            robot=robot,
            time_s=self.time_s,
            pose_m_rad=pose,
            place=self.world.place_at(*pose[:2]),
            holding=me.holding,
            basket=tuple(me.basket),
            moving=me.route is not None,
        )

    def truths(self) -> tuple[Truth, ...]:
        found = []
        for thing in self._things.values():
            point, holder = self._point(thing), self._held_by(thing)
            carrier = self._robots.get(holder or thing.support)
            found.append(
                Truth(
                    object=thing.name,
                    kind=thing.kind,
                    time_s=self.time_s,
                    point_m=point,
                    place=self.world.place_at(*point[:2]),
                    support=thing.support or None,
                    held_by=holder,
                    settled=holder is None and (carrier is None or carrier.route is None),
                )
            )
        return tuple(found)

    def contacts(self) -> ContactCount:
        return ContactCount(time_s=self.time_s, robot_robot=0, robot_wall=0)

    def scene(self) -> Scene:
        return draw_scene(self.world, self.robots)

    def frame(self) -> Frame:
        return draw_frame(
            self.time_s,
            {name: self._pose(robot) for name, robot in self._robots.items()},
            {name: self._point(thing) for name, thing in self._things.items()},
        )


_MISHAPS = {
    MotionKind.GRASP: "the object slipped out of the hand",
    MotionKind.RELEASE: "the hand could not get to the point",
    MotionKind.RELEASE_IN_BASKET: "the basket was not where it should be",
    MotionKind.LOOK: "the camera gave no picture",
    MotionKind.STOW: "the arm got stuck",
}
