"""A robot that is told to stop: nobody hears that it rests before it does, and then it stays."""

from __future__ import annotations

import math

import pytest

from keyexpr_schema.payloads.motions import Motion, MotionKind, MotionOutcome, MotionState
from keyexpr_schema.payloads.simulation import MotionCall
from keyexpr_schema.payloads.stops import Stop
from sim.files.mission_file import load_mission
from sim.mujoco_world.backend import MujocoBackend
from sim.mujoco_world.base_controllers import PERIOD_S
from sim.navigation import Navigator
from sim.navigation.clearance import segment_gap
from sim.navigation.lattice import PITCH_M, TRACKING_M
from sim.navigation.spots import Spots
from sim.server.motion_calls import MotionCalls
from workers.stops import StopSwitch

GO = {"hsr": "hallway", "locobot": "kitchen"}
FAST_M_S = 0.5
ACCELERATION_M_S2 = 0.8
STAYS_M, STAYS_RAD = 1e-3, 1e-3
S1 = (Stop(stop="s1"),)


class Driven:
    """The two-cups world, and the calls of one robot, which is on its way as fast as it goes."""

    def __init__(self, robot: str) -> None:
        mission = load_mission("two-cups")
        robots = [(each.spec, each.start_m_rad) for each in mission.robots]
        self.world, self.robot = MujocoBackend(mission.world, robots), robot
        self.stops = StopSwitch()
        self.calls = MotionCalls(self.world, robot, self.stops)
        assert self.ask("go", MotionKind.GO_TO, place=GO[robot]) is None
        while self.speed() < FAST_M_S:
            self.step()

    def ask(
        self, name: str, kind: MotionKind | None = None, **what: object
    ) -> MotionOutcome | None:
        """The answer to a call, if there is one yet."""
        motion = None if kind is None else Motion(kind=kind, place=what.pop("place", None))  # type: ignore[arg-type]
        call = MotionCall(call=name, incarnation="i1", motion=motion, **what)  # type: ignore[arg-type]
        return self.calls.accept(call, 0.0)

    def step(self) -> None:
        self.world.advance()
        self.calls.settle(0.0, 0.0)

    def pose(self) -> tuple[float, float, float]:
        return self.world.senses(self.robot).pose_m_rad

    def speed(self) -> float:
        before, _ = self.pose(), self.world.advance()
        return math.dist(before[:2], self.pose()[:2]) / 0.05

    def check_it_stays(self) -> None:
        """It rests, and goes on doing so for ten seconds, though nobody else keeps time going."""
        assert not self.calls.active
        here = self.pose()
        for _ in range(200):
            self.step()
        there = self.pose()
        assert math.dist(here[:2], there[:2]) < STAYS_M
        assert abs(math.remainder(here[2] - there[2], math.tau)) < STAYS_RAD


@pytest.mark.parametrize("robot", GO)
def test_no_stop_is_answered_before_the_robot_rests(robot: str) -> None:
    driven = Driven(robot)
    begun = driven.pose()
    periods = 0
    while (answer := driven.ask("stop", stop=True)) is None:
        assert driven.calls.active, "or a world that keeps time by motions would stand still"
        assert driven.ask("go", MotionKind.GO_TO, place=GO[robot]) is None, "nor is its motion over"
        driven.step()
        periods += 1
    assert answer.state is MotionState.STOPPED
    assert math.dist(begun[:2], driven.pose()[:2]) > 0.1, "it was fast, and braked"
    assert periods < 40
    motion = driven.ask("go", MotionKind.GO_TO, place=GO[robot])
    assert motion is not None and motion.state is MotionState.STOPPED
    assert motion.senses.pose_m_rad == answer.senses.pose_m_rad == driven.pose()
    assert not answer.senses.moving
    driven.check_it_stays()
    # As soon as it may make way again it goes where it is in nobody's way, on a node of its own.
    assert driven.ask("free", release=True) is not None
    assert robot not in driven.world.held


def test_an_emergency_stop_that_the_worker_heard_first_holds_before_the_driver_has_heard() -> None:
    driven = Driven("locobot")
    driven.ask("stop", stop=True)
    while driven.calls.active:
        driven.step()
    driven.check_it_stays()
    driven.stops.set(S1)
    driven.calls.obey_stops()
    driven.check_it_stays()
    driven.stops.set(())
    driven.calls.obey_stops()
    assert not driven.world.held


def test_an_emergency_stop_lets_time_go_on_until_a_robot_without_a_motion_rests() -> None:
    driven = Driven("locobot")
    driven.ask("go", stop=True)  # its worker has stopped that motion, and no more
    driven.stops.set(S1)
    driven.calls.obey_stops()
    assert driven.calls.active
    while driven.calls.active:
        driven.step()
    driven.check_it_stays()
    refused = driven.ask("another", MotionKind.GO_TO, place="kitchen")
    assert refused is not None and refused.state is MotionState.STOPPED


def test_a_motion_that_fails_on_the_way_has_failed_when_the_robot_rests() -> None:
    driven = Driven("hsr")
    late = MotionCall(
        call="late",
        incarnation="i1",
        motion=Motion(kind=MotionKind.GO_TO, place="living_room", timeout_s=0.1),
    )
    assert driven.calls.accept(late, 0.0) is None
    begun = driven.pose()
    while (answer := driven.calls.accept(late, 0.0)) is None:
        driven.step()
    assert answer.state is MotionState.FAILED
    assert answer.senses.pose_m_rad == driven.pose()
    assert math.dist(begun[:2], driven.pose()[:2]) > 0.1, "it was on its way"
    before = driven.pose()
    driven.world.advance()
    assert math.dist(before[:2], driven.pose()[:2]) < STAYS_M


def test_a_motion_that_takes_the_place_of_another_waits_for_nothing() -> None:
    driven = Driven("hsr")
    driven.ask("stop", stop=True)
    assert driven.ask("back", MotionKind.GO_TO, place="kitchen") is None
    stopped, moved = driven.ask("stop", stop=True), driven.ask("go", stop=True)
    assert stopped is not None and stopped.state is MotionState.FAILED, "it does not rest"
    assert moved is not None and moved.state is MotionState.STOPPED


def test_a_robot_that_is_sent_nowhere_any_more_owns_what_it_brakes_on() -> None:
    """At any moment of a fast drive through the house."""
    mission = load_mission("two-cups")
    points = Spots(mission.world).lattice.points
    navigator, pose = Navigator(mission.world), mission.robots[0].start_m_rad
    navigator.add_robot("hsr", pose, 0.25)
    navigator.go_to_place("hsr", "kitchen")
    speed, moments = 0.0, 0
    for period in range(150):
        leg = navigator.tick(0.0, {"hsr": pose})["hsr"]
        speed = min(leg.speed_limit_m_s, speed + ACCELERATION_M_S2 * PERIOD_S)
        x, y = leg.target_m[0] - pose[0], leg.target_m[1] - pose[1]
        ahead, gone = math.atan2(y, x), min(speed * PERIOD_S, math.hypot(x, y))
        pose = (pose[0] + gone * math.cos(ahead), pose[1] + gone * math.sin(ahead), ahead)
        if speed < FAST_M_S or period % 3:
            continue
        moments += 1
        navigator.cancel("hsr")
        brakes = speed**2 / (2.0 * ACCELERATION_M_S2)
        ends = (pose[0] + brakes * math.cos(ahead), pose[1] + brakes * math.sin(ahead))
        own = [points[node] for node in navigator.reserved("hsr")]
        steps = [(a, b) for a in own for b in own if math.dist(a, b) < 1.5 * PITCH_M]
        gap = min(segment_gap(step, (ends, ends)) for step in steps)
        assert gap < TRACKING_M, "or it ends where another robot may be let in"
        navigator.go_to_place("hsr", "kitchen")
    assert moments > 10
