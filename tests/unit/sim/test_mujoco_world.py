"""The assembled world at rest: what stands where, what is drawn, and that nothing drifts."""

from __future__ import annotations

import math

import pytest

from keyexpr_schema.payloads.motions import Motion, MotionKind, MotionState
from keyexpr_schema.payloads.simulation import ShapeKind
from sim.backend import NEEDS
from sim.files.mission_file import load_mission
from sim.mujoco_world import MujocoBackend
from sim.mujoco_world.backend import MOTIONS

MISSION = load_mission("two-cups")


@pytest.fixture(scope="module")
def resting() -> MujocoBackend:
    backend = MujocoBackend(MISSION.world, [(r.spec, r.start_m_rad) for r in MISSION.robots])
    for _ in range(600):
        backend.advance()
    return backend


def test_idle_robots_and_objects_stay_where_they_were_put(resting: MujocoBackend) -> None:
    assert resting.time_s == pytest.approx(30.0)
    for robot in MISSION.robots:
        x, y, yaw = resting.senses(robot.spec.robot).pose_m_rad
        to_x, to_y, to_yaw = robot.start_m_rad
        assert math.dist((x, y), (to_x, to_y)) < 0.005
        assert abs(math.remainder(yaw - to_yaw, math.tau)) < 0.01
        assert not resting.senses(robot.spec.robot).moving
    for truth in resting.truths():
        start = MISSION.world.start_point_m(truth.object)
        assert math.dist(truth.point_m, start) < 0.002
    assert resting.contacts().robot_robot == resting.contacts().robot_wall == 0


def test_every_kind_of_motion_has_its_rows() -> None:
    assert set(NEEDS) == set(MOTIONS) == set(MotionKind)


def test_truth_knows_where_everything_rests(resting: MujocoBackend) -> None:
    truths = {truth.object: truth for truth in resting.truths()}
    assert list(truths) == ["cup_1", "cup_2"]
    for truth in truths.values():
        assert truth.place == "kitchen"
        assert truth.support == "kitchen_table"
        assert truth.held_by is None
        assert truth.settled


def test_the_scene_has_every_body_once_and_every_frame_has_those_that_move(
    resting: MujocoBackend,
) -> None:
    scene, frame = resting.scene(), resting.frame()
    names = [body.body for body in scene.bodies]
    assert len(names) == len(set(names))
    assert set(scene.fixed) | set(frame.poses) == set(names)
    assert not set(scene.fixed) & set(frame.poses)
    assert {"floor", "walls", "furniture/kitchen_table", "furniture/sofa"} <= set(scene.fixed)
    owners = {body.owner for body in scene.bodies}
    assert owners == {None, "hsr", "locobot", "cup_1", "cup_2"}
    assert {"object/cup_1", "hsr/base", "hsr/hand", "locobot/basket"} <= set(frame.poses)
    cup = next(body for body in scene.bodies if body.owner == "cup_1")
    assert [shape.kind for shape in cup.shapes] == [ShapeKind.CYLINDER]
    assert cup.shapes[0].size_m == pytest.approx((0.035, 0.05, 0.0))


def test_tables_are_a_top_on_four_legs_and_doors_are_open(resting: MujocoBackend) -> None:
    scene = resting.scene()
    table = next(body for body in scene.bodies if body.body == "furniture/kitchen_table")
    assert len(table.shapes) == 5
    highest = max(shape.point_m[2] + shape.size_m[2] for shape in table.shapes)
    assert highest == pytest.approx(0.60)
    walls = next(body for body in scene.bodies if body.body == "walls")
    assert len(walls.shapes) == 4 + 4
    for door in MISSION.world.doors.values():
        for shape in walls.shapes:
            along = max(shape.size_m[0], shape.size_m[1])
            gap = math.dist(shape.point_m[:2], door.center_m) - along
            crosses = abs(shape.point_m[0] - door.center_m[0]) < 0.2
            assert not crosses or gap >= door.width_m / 2 - 0.01


@pytest.mark.parametrize(
    ("robot", "motion", "words"),
    [
        ("locobot", Motion(kind=MotionKind.STOW), "locobot has no arm"),
        (
            "locobot",
            Motion(kind=MotionKind.GRASP, object="cup_1", point_m=(0.7, 4.8, 0.6)),
            "locobot has no hand",
        ),
        (
            "hsr",
            Motion(kind=MotionKind.GRASP, object="cup_1", point_m=(0.7, 4.8, 0.6)),
            "approach it first",
        ),
        ("hsr", Motion(kind=MotionKind.RELEASE, point_m=(5.0, 5.5, 0.6)), "the hand is empty"),
        (
            "hsr",
            Motion(kind=MotionKind.RELEASE_IN_BASKET, robot="locobot"),
            "the hand is empty",
        ),
        ("hsr", Motion(kind=MotionKind.APPROACH, point_m=(0.4, 0.5, 0.9)), "there is room only"),
    ],
)
def test_what_a_robot_cannot_do_fails_with_a_sentence(
    resting: MujocoBackend, robot: str, motion: Motion, words: str
) -> None:
    resting.begin(robot, motion)
    for _ in range(40):
        resting.advance()
    outcome = resting.outcome(robot)
    assert outcome is not None
    assert outcome.state is MotionState.FAILED
    assert words in (outcome.reason or "")


def in_the_door() -> MujocoBackend:
    """HSR wants into the hallway, and LoCoBot stands about in the door, which is too narrow."""
    hsr, locobot = (robot.spec for robot in MISSION.robots)
    backend = MujocoBackend(MISSION.world, [(hsr, (8.0, 3.0, math.pi)), (locobot, DOOR)])
    backend.begin("hsr", Motion(kind=MotionKind.GO_TO, place="hallway", timeout_s=60.0))
    return backend


DOOR = (6.0, 3.0, 0.0)


def from_the_door(backend: MujocoBackend) -> float:
    x, y, _ = backend.senses("locobot").pose_m_rad
    return math.dist((x, y), DOOR[:2])


def test_who_is_held_or_has_an_empty_battery_makes_way_for_nobody() -> None:
    for empty in (False, True):
        world = in_the_door()
        while from_the_door(world) < 0.1:  # on its way out of the door already
            world.advance()
        if empty:
            world.batteries.set_charge("locobot", 0.0)
        else:
            world.hold("locobot", True)
        for _ in range(40):
            world.advance()
        here = from_the_door(world)
        assert here < 0.2
        for _ in range(160):
            world.advance()
        assert from_the_door(world) == pytest.approx(here, abs=0.005)
        assert world.is_running("hsr"), "it waits"
    world.batteries.set_charge("locobot", 50.0)
    while world.is_running("hsr"):
        world.advance()
    done = world.outcome("hsr")
    assert done is not None and done.state is MotionState.SUCCEEDED
