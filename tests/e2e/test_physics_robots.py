"""What the physics says of driving, seeing, time limits, and that a run can be repeated."""

from __future__ import annotations

import math

import msgspec
import pytest

from keyexpr_schema.payloads.motions import Motion, MotionKind, MotionOutcome, MotionState
from keyexpr_schema.payloads.robots import PoseMRad
from sim.files.mission_file import load_mission
from sim.mujoco_world import MujocoBackend

MISSION = load_mission("two-cups")
SPECS = {robot.spec.robot: robot.spec for robot in MISSION.robots}


def start(seed: int = 0, **poses: PoseMRad) -> MujocoBackend:
    """The two-cups world with robots at other poses than the mission's."""
    robots = [(r.spec, poses.get(r.spec.robot, r.start_m_rad)) for r in MISSION.robots]
    return MujocoBackend(MISSION.world, robots, seed=seed)


def finish(backend: MujocoBackend, *robots: str) -> list[MotionOutcome]:
    while True:
        backend.advance()
        outcomes = [outcome for robot in robots if (outcome := backend.outcome(robot))]
        assert len(outcomes) == len(robots)
        if all(outcome.state is not MotionState.RUNNING for outcome in outcomes):
            return outcomes


def look(backend: MujocoBackend, robot: str) -> MotionOutcome:
    backend.begin(robot, Motion(kind=MotionKind.LOOK))
    return finish(backend, robot)[0]


@pytest.mark.parametrize("robot", ["hsr", "locobot"])
def test_a_robot_in_the_kitchen_sees_both_cups_where_they_are(robot: str) -> None:
    elsewhere = {"hsr": (8.0, 3.0, 0.0), "locobot": (5.0, 1.5, 0.0), robot: (2.4, 3.0, 2.0)}
    backend = start(**elsewhere)
    outcome = look(backend, robot)
    assert outcome.state is MotionState.SUCCEEDED
    assert [one.object for one in outcome.detections] == ["cup_1", "cup_2"]
    for one in outcome.detections:
        assert (one.kind, one.place, one.support) == ("cup", "kitchen", "kitchen_table")
        assert math.dist(one.point_m, MISSION.world.start_point_m(one.object)) < 0.015


@pytest.mark.parametrize("pose", [(5.0, 1.5, 1.6), (8.0, 3.0, 3.1)])
def test_nobody_sees_through_walls_or_farther_than_the_camera_can(pose: PoseMRad) -> None:
    backend = start(hsr=pose, locobot=(7.5, 4.0, 0.0))
    assert look(backend, "hsr").detections == ()


def test_the_range_of_the_camera_is_that_of_the_robots_file() -> None:
    spec = msgspec.structs.replace(
        SPECS["hsr"], capabilities={**SPECS["hsr"].capabilities, "see": 1.0}
    )
    backend = MujocoBackend(MISSION.world, [(spec, (2.4, 3.0, 2.0))])
    assert look(backend, "hsr").detections == ()


@pytest.mark.slow
def test_two_robots_cross_through_one_door_without_touching() -> None:
    backend = start(hsr=(2.5, 3.0, 0.0), locobot=(7.5, 3.0, 3.14))
    for _ in range(2):
        backend.begin("hsr", Motion(kind=MotionKind.GO_TO, place="living_room"))
        backend.begin("locobot", Motion(kind=MotionKind.GO_TO, place="kitchen"))
        outcomes = finish(backend, "hsr", "locobot")
        assert [outcome.state for outcome in outcomes] == [MotionState.SUCCEEDED] * 2
        assert [outcome.senses.place for outcome in outcomes] == ["living_room", "kitchen"]
        backend.begin("hsr", Motion(kind=MotionKind.GO_TO, place="kitchen"))
        backend.begin("locobot", Motion(kind=MotionKind.GO_TO, place="living_room"))
        outcomes = finish(backend, "hsr", "locobot")
        assert [outcome.senses.place for outcome in outcomes] == ["kitchen", "living_room"]
    contacts = backend.contacts()
    assert (contacts.robot_wall, contacts.robot_robot) == (0, 0)


@pytest.mark.parametrize(
    ("hsr_x_m", "locobot_x_m", "counted"), [(9.75, 8.0, (1, 0)), (9.0, 8.6, (0, 1))]
)
def test_collisions_are_noticed_and_counted_once(
    hsr_x_m: float, locobot_x_m: float, counted: tuple[int, int]
) -> None:
    """Put into a wall, and into each other: the navigator would never lead them there."""
    backend = start(hsr=(hsr_x_m, 3.0, 0.0), locobot=(locobot_x_m, 3.0, 0.0))
    for _ in range(100):
        backend.advance()
    contacts = backend.contacts()
    assert (contacts.robot_wall, contacts.robot_robot) == counted


def test_a_motion_that_takes_too_long_fails_and_the_robot_halts() -> None:
    backend = start()
    backend.begin("hsr", Motion(kind=MotionKind.GO_TO, place="kitchen", timeout_s=2.0))
    outcome = finish(backend, "hsr")[0]
    assert outcome.state is MotionState.FAILED
    assert outcome.reason == "go_to took longer than 2 s; it was driving to kitchen"
    assert outcome.senses.time_s == pytest.approx(2.0, abs=0.11)
    for _ in range(60):
        backend.advance()
    assert not backend.senses("hsr").moving


def test_a_new_motion_takes_the_place_of_the_old_one() -> None:
    backend = start()
    backend.begin("hsr", Motion(kind=MotionKind.GO_TO, place="kitchen"))
    for _ in range(40):
        backend.advance()
    backend.begin("hsr", Motion(kind=MotionKind.GO_TO, place="living_room"))
    outcome = finish(backend, "hsr")[0]
    assert outcome.state is MotionState.SUCCEEDED
    assert outcome.senses.place == "living_room"


def test_the_same_commands_give_the_same_run_to_the_last_bit() -> None:
    ends = []
    for _ in range(2):
        backend = start(seed=3)
        point = MISSION.world.start_point_m("cup_2")
        backend.begin("locobot", Motion(kind=MotionKind.GO_TO, place="kitchen"))
        backend.begin("hsr", Motion(kind=MotionKind.APPROACH, point_m=point))
        finish(backend, "hsr", "locobot")
        backend.begin("hsr", Motion(kind=MotionKind.GRASP, object="cup_2", point_m=point))
        backend.begin("locobot", Motion(kind=MotionKind.LOOK))
        seen = finish(backend, "hsr", "locobot")[1].detections
        ends.append((backend.time_s, backend.frame(), backend.truths(), seen))
    assert ends[0] == ends[1]
    assert ends[0][2][1].held_by == "hsr"
