"""The world without physics: what motions do, when they fail, and that it is quick."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from keyexpr_schema.payloads.motions import Motion, MotionKind, MotionOutcome, MotionState
from sim.files.mission_file import load_mission
from sim.kinematic.backend import KinematicBackend, MotionModel

MISSION = load_mission("two-cups")
ROBOTS = tuple((robot.spec, robot.start_m_rad) for robot in MISSION.robots)
CUP_M = MISSION.world.start_point_m("cup_1")
K = MotionKind


def world(**options: Any) -> KinematicBackend:
    return KinematicBackend(MISSION.world, ROBOTS, **options)


def do(backend: KinematicBackend, who: str, kind: MotionKind, **fields: Any) -> MotionOutcome:
    backend.begin(who, Motion(kind=kind, **fields))
    while True:
        outcome = backend.outcome(who)
        assert outcome is not None
        if outcome.state is not MotionState.RUNNING:
            return outcome
        backend.advance()


def pick(backend: KinematicBackend) -> MotionOutcome:
    do(backend, "hsr", K.APPROACH, point_m=CUP_M)
    return do(backend, "hsr", K.GRASP, object="cup_1", point_m=CUP_M)


def truth(backend: KinematicBackend, name: str) -> Any:
    return next(truth for truth in backend.truths() if truth.object == name)


def test_a_cup_goes_from_the_table_over_a_basket_to_the_floor_of_another_place() -> None:
    backend = world()
    do(backend, "hsr", K.GO_TO, place="kitchen")
    seen = do(backend, "hsr", K.LOOK).detections
    assert {found.object: found.support for found in seen} == {
        "cup_1": "kitchen_table",
        "cup_2": "kitchen_table",
    }
    assert pick(backend).senses.holding == "cup_1"
    assert truth(backend, "cup_1").held_by == "hsr"
    do(backend, "locobot", K.GO_TO, place="kitchen")
    x, y, _ = backend.senses("locobot").pose_m_rad
    do(backend, "hsr", K.APPROACH, point_m=(x, y, 0.3))
    assert do(backend, "hsr", K.RELEASE_IN_BASKET, robot="locobot").senses.holding is None
    assert backend.senses("locobot").basket == ("cup_1",)
    do(backend, "locobot", K.GO_TO, place="hallway")
    carried = truth(backend, "cup_1")
    assert (carried.place, carried.support, carried.settled) == ("hallway", "locobot", True)
    do(backend, "hsr", K.GO_TO, place="hallway")
    do(backend, "hsr", K.APPROACH, point_m=carried.point_m)
    assert do(backend, "hsr", K.GRASP, object="cup_1", point_m=carried.point_m).reason is None
    assert backend.senses("locobot").basket == ()
    x, y, _ = backend.senses("hsr").pose_m_rad
    do(backend, "hsr", K.RELEASE, point_m=(x + 0.3, y, 0.0))
    put = truth(backend, "cup_1")
    assert (put.place, put.support, put.held_by, put.settled) == ("hallway", "floor", None, True)


@pytest.mark.parametrize(
    ("robot", "motion", "said"),
    [
        ("hsr", Motion(kind=K.GO_TO, place="moon"), "there is no place 'moon'; there are kitchen"),
        ("hsr", Motion(kind=K.GO_TO), "go_to needs `place`"),
        (
            "hsr",
            Motion(kind=K.GRASP, object="x", point_m=CUP_M),
            "there is no object 'x'; there are",
        ),
        (
            "hsr",
            Motion(kind=K.RELEASE_IN_BASKET, robot="x"),
            "there is no robot 'x'; there are hsr",
        ),
        ("hsr", Motion(kind=K.RELEASE_IN_BASKET, robot="hsr"), "its own basket"),
        ("hsr", Motion(kind=K.RELEASE, point_m=CUP_M), "the hand is empty"),
        ("hsr", Motion(kind=K.GRASP, object="cup_1", point_m=CUP_M), "out of reach"),
        ("hsr", Motion(kind=K.GRASP, object="cup_1", point_m=(8, 3, 0)), "is not there"),
        ("locobot", Motion(kind=K.GRASP, object="cup_1", point_m=CUP_M), "locobot has no hand"),
        ("hsr", Motion(kind=K.GO_TO, place="kitchen", timeout_s=1.0), "it took longer than 1 s"),
    ],
)
def test_what_cannot_be_done_fails_with_a_sentence(robot: str, motion: Motion, said: str) -> None:
    backend = world()
    backend.begin(robot, motion)
    while (outcome := backend.outcome(robot)) and outcome.state is MotionState.RUNNING:
        backend.advance()
    assert outcome is not None and outcome.state is MotionState.FAILED
    assert outcome.reason is not None and said in outcome.reason


def test_scripted_failures_happen_and_are_over() -> None:
    backend = world(motion_model=MotionModel(failures={"hsr": {"grasp": (1, 2)}}))
    assert [pick(backend).state for _ in range(3)] == [
        MotionState.FAILED,
        MotionState.FAILED,
        MotionState.SUCCEEDED,
    ]


def test_chance_failures_follow_the_seed() -> None:
    def draws(seed: int) -> list[bool]:
        backend = world(
            motion_model=MotionModel(failure_chance={"look": 0.5}, spread=0.3), seed=seed
        )
        return [do(backend, "hsr", K.LOOK).state is MotionState.FAILED for _ in range(40)]

    assert draws(1) == draws(1) != draws(2)
    assert 8 < sum(draws(1)) < 32


def test_driving_takes_the_way_over_the_speed() -> None:
    backend = world()
    do(backend, "hsr", K.GO_TO, place="kitchen")
    assert 6.0 / 0.6 * 0.7 < backend.time_s < 6.0 / 0.6 * 1.3


def test_a_stopped_robot_is_where_it_was_stopped() -> None:
    backend = world(step_s=0.05)
    backend.begin("hsr", Motion(kind=K.GO_TO, place="kitchen"))
    for _ in range(40):
        backend.advance()
    moving = backend.senses("hsr")
    backend.stop("hsr")
    stopped = backend.outcome("hsr")
    assert moving.moving and stopped is not None and stopped.state is MotionState.STOPPED
    assert stopped.senses.pose_m_rad == moving.pose_m_rad
    for _ in range(40):
        backend.advance()
    assert backend.senses("hsr").pose_m_rad == moving.pose_m_rad
    assert 6.0 < moving.pose_m_rad[0] < 7.5  # two seconds on its way


def test_frames_hold_every_body_that_the_scene_does_not_fix() -> None:
    backend = world()
    scene, frame = backend.scene(), backend.frame()
    assert {body.body for body in scene.bodies} == set(scene.fixed) | set(frame.poses)


def test_a_hundred_robots_make_thousands_of_motions_in_as_many_steps() -> None:
    robots = [
        (msgspec.structs.replace(ROBOTS[k % 2][0], robot=f"r{k}"), ROBOTS[k % 2][1])
        for k in range(100)
    ]
    backend = KinematicBackend(MISSION.world, robots, MotionModel(spread=0.3))
    places = list(MISSION.world.place_entries)
    steps = motions = 0
    while motions < 3_000:
        for name in backend.robots:
            outcome = backend.outcome(name)
            if outcome is None or outcome.state is not MotionState.RUNNING:
                kind = (K.LOOK, K.GO_TO)[motions % 2]
                place = places[motions % 3] if kind is K.GO_TO else None
                backend.begin(name, Motion(kind=kind, place=place))
                motions += 1
        backend.advance()
        steps += 1
    assert steps <= motions, "it goes from event to event"
    assert backend.time_s > 100.0


def test_an_arm_that_does_not_drive_does_what_is_in_its_reach_and_refuses_the_rest() -> None:
    mission = load_mission("workshop")
    backend = KinematicBackend(
        mission.world, [(robot.spec, robot.start_m_rad) for robot in mission.robots]
    )
    do(backend, "bench_arm", K.GO_TO, place="hall")  # it is there
    gear = next(truth.point_m for truth in backend.truths() if truth.object == "gear_1")
    for kind, fields in ((K.GO_TO, {"place": "store"}), (K.APPROACH, {"point_m": gear})):
        outcome = do(backend, "bench_arm", kind, **fields)
        assert outcome.state is MotionState.FAILED
        assert "bench_arm does not drive" in (outcome.reason or "")
        assert not outcome.retryable
    do(backend, "rack_arm", K.APPROACH, point_m=gear)
    do(backend, "rack_arm", K.GRASP, object="gear_1", point_m=gear)
    do(backend, "locobot", K.GO_TO, place="rack_place")
    do(backend, "rack_arm", K.RELEASE_IN_BASKET, robot="locobot")
    assert backend.senses("locobot").basket == ("gear_1",)
