"""What the physics says of opening, switching, putting on and in, and giving to people."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import msgspec
import pytest

from keyexpr_schema.payloads.motions import Motion, MotionKind, MotionOutcome, MotionState
from keyexpr_schema.payloads.simulation import Truth
from sim.files.robot_file import load_robot
from sim.files.world_file import load_world
from sim.mujoco_world import MujocoBackend
from tests.support.furnished import furnished, hsr
from tests.support.wheeled_arm import wheeled_arm

K = MotionKind


def run(backend: MujocoBackend, kind: MotionKind, who: str = "hsr", **fields: Any) -> MotionOutcome:
    backend.begin(who, Motion(kind=kind, **fields))
    while backend.is_running(who):
        backend.advance()
    outcome = backend.outcome(who)
    assert outcome is not None
    return outcome


def do(backend: MujocoBackend, kind: MotionKind, who: str = "hsr", **fields: Any) -> MotionOutcome:
    outcome = run(backend, kind, who, **fields)
    assert outcome.state is MotionState.SUCCEEDED, f"{kind.value} {fields}: {outcome.reason}"
    return outcome


def truth(backend: MujocoBackend, name: str) -> Truth:
    return next(truth for truth in backend.truths() if truth.object == name)


def take(backend: MujocoBackend, name: str) -> None:
    point = truth(backend, name).point_m
    do(backend, K.APPROACH, point_m=point)
    do(backend, K.GRASP, object=name, point_m=point)


def touched(backend: MujocoBackend) -> int:
    contacts = backend.contacts()
    return contacts.robot_robot + contacts.robot_wall


def test_a_cup_is_taken_out_of_a_closed_cupboard_onto_a_board_under_another(
    tmp_path: Path,
) -> None:
    backend = MujocoBackend(furnished(tmp_path), [hsr()])
    assert truth(backend, "cupboard").states == {"is_open": False}
    seen = {one.object: one for one in do(backend, K.LOOK).detections}
    assert "cup_1" not in seen
    assert seen["cupboard"].states == {"is_open": False}
    do(backend, K.OPEN, object="cupboard")
    assert truth(backend, "cupboard").states == {"is_open": True}
    seen = {one.object: one for one in do(backend, K.LOOK).detections}
    assert seen["cup_1"].support == "cupboard"
    take(backend, "cup_1")
    assert truth(backend, "cup_1").held_by == "hsr"
    assert "the hand is not empty" in (run(backend, K.CLOSE, object="cupboard").reason or "")
    do(backend, K.PLACE_AT, object="bookcase_board_2")
    cup = truth(backend, "cup_1")
    assert (cup.support, cup.place, cup.settled) == ("bookcase_board_2", "hall", True)
    do(backend, K.CLOSE, object="cupboard")
    assert truth(backend, "cupboard").states == {"is_open": False}
    assert touched(backend) == 0


def test_a_bowl_takes_along_what_was_put_in_it_and_a_person_takes_the_bowl(
    tmp_path: Path,
) -> None:
    backend = MujocoBackend(furnished(tmp_path), [hsr()])
    do(backend, K.OPEN, object="dresser_drawer_1")
    assert truth(backend, "spoon_1").support == "dresser_drawer_1"
    take(backend, "spoon_1")
    do(backend, K.PLACE_AT, object="bowl_1")
    assert truth(backend, "spoon_1").support == "bowl_1"
    do(backend, K.CLOSE, object="dresser_drawer_1")
    take(backend, "bowl_1")
    spoon = truth(backend, "spoon_1")
    assert (spoon.support, spoon.held_by) == ("bowl_1", None)
    do(backend, K.HAND_OVER, object="anna")
    for _ in range(40):
        backend.advance()
    assert (truth(backend, "bowl_1").support, truth(backend, "bowl_1").place) == ("anna", "hall")
    assert truth(backend, "spoon_1").support == "bowl_1"
    take(backend, "mug_1")
    assert "has something in the hand" in (run(backend, K.HAND_OVER, object="anna").reason or "")
    do(backend, K.PLACE_AT, object="table")
    take(backend, "bowl_1")
    assert truth(backend, "bowl_1").held_by == "hsr"
    assert touched(backend) == 0


def test_a_switch_changes_over_when_a_finger_presses_it(tmp_path: Path) -> None:
    backend = MujocoBackend(furnished(tmp_path), [hsr()])
    for thing in ("lamp", "oven"):
        do(backend, K.SWITCH_ON, object=thing)
        assert truth(backend, thing).states == {"is_on": True}
        before_s = backend.time_s
        do(backend, K.SWITCH_ON, object=thing)
        assert backend.time_s - before_s < 0.1, "it is on already"
        do(backend, K.SWITCH_OFF, object=thing)
        assert truth(backend, thing).states == {"is_on": False}
    assert touched(backend) == 0


def test_what_stands_on_an_oven_that_is_on_gets_hot(tmp_path: Path) -> None:
    backend = MujocoBackend(furnished(tmp_path), [hsr()])
    take(backend, "mug_1")
    do(backend, K.PLACE_AT, object="oven")
    do(backend, K.SWITCH_ON, object="oven")
    begun_s = backend.time_s
    while truth(backend, "mug_1").states != {"temperature": "hot"}:
        backend.advance()
        assert backend.time_s - begun_s < 21.0
    assert truth(backend, "bowl_1").states == {}


def test_what_one_robot_has_put_into_a_basket_another_takes_out_of_it(tmp_path: Path) -> None:
    carrier = (load_robot("locobot"), (4.0, 2.5, 0.0))
    backend = MujocoBackend(furnished(tmp_path), [hsr(), carrier])
    take(backend, "mug_1")

    def beside() -> None:
        x, y, _ = backend.senses("locobot").pose_m_rad
        do(backend, K.APPROACH, point_m=(x, y, 0.34))

    beside()
    do(backend, K.RELEASE_IN_BASKET, robot="locobot")
    assert truth(backend, "mug_1").support == "locobot"
    do(backend, K.GO_TO, "locobot", place="hall")
    beside()
    point = truth(backend, "mug_1").point_m
    do(backend, K.GRASP, object="mug_1", robot="locobot", point_m=point)
    assert truth(backend, "mug_1").held_by == "hsr"
    assert backend.senses("locobot").basket == ()
    assert touched(backend) == 0


def test_what_cannot_be_done_with_furniture_is_said(tmp_path: Path) -> None:
    backend = MujocoBackend(furnished(tmp_path), [hsr()])
    take(backend, "mug_1")
    assert "closed: open it first" in (run(backend, K.PLACE_AT, object="cupboard").reason or "")
    assert "not something to open" in (run(backend, K.OPEN, object="table").reason or "")
    assert truth(backend, "mug_1").held_by == "hsr"


@pytest.mark.parametrize("periods", [170, 230, 300])
def test_an_opening_that_was_stopped_is_taken_up_again(tmp_path: Path, periods: int) -> None:
    backend = MujocoBackend(furnished(tmp_path), [hsr()])
    backend.begin("hsr", Motion(kind=K.OPEN, object="cupboard"))
    for _ in range(periods):
        backend.advance()
    backend.stop("hsr")
    for _ in range(20):
        backend.advance()
    do(backend, K.STOW)
    do(backend, K.OPEN, object="cupboard")
    assert truth(backend, "cupboard").states == {"is_open": True}
    take(backend, "cup_1")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_doors_and_drawers_work_and_give_out_a_cup_wherever_a_robot_comes_from(
    tmp_path: Path, seed: int
) -> None:
    chance = random.Random(seed)
    start = (chance.uniform(1.5, 4.3), chance.uniform(1.6, 3.2), chance.uniform(-3.1, 3.1))
    world = furnished(tmp_path)
    furniture = dict(world.furniture)
    for name in ("cupboard", "dresser"):
        x, y = furniture[name].center_m
        side = chance.choice(["left", "right"])
        furniture[name] = msgspec.structs.replace(
            furniture[name], center_m=(x + chance.uniform(-0.25, 0.25), y), hinge=side
        )
    objects = dict(world.object_entries)
    x, y = objects["cup_1"].at_m
    objects["cup_1"] = msgspec.structs.replace(
        objects["cup_1"], at_m=(x + chance.uniform(-0.08, 0.08), y + chance.uniform(-0.03, 0.05))
    )
    world = msgspec.structs.replace(world, furniture=furniture, object_entries=objects)
    backend = MujocoBackend(world, [hsr(start)], seed)
    do(backend, K.OPEN, object="cupboard")
    take(backend, "cup_1")
    do(backend, K.PLACE_AT, object="table")
    assert truth(backend, "cup_1").support == "table"
    do(backend, K.CLOSE, object="cupboard")
    for thing in ("dresser_drawer_1", "dresser_drawer_2"):
        do(backend, K.OPEN, object=thing)
        assert truth(backend, thing).states == {"is_open": True}
        do(backend, K.CLOSE, object=thing)
        assert truth(backend, thing).states == {"is_open": False}
    assert touched(backend) == 0


NEIGHBOURS = """
world: row
size_m: [6.0, 4.0]
places:
  kitchen: {label: Kitchen, region_m: [[0.0, 0.0, 6.0, 4.0]]}
furniture:
  left:
    kind: cupboard
    place: kitchen
    center_m: [1.3, 3.7]
    size_m: [0.6, 0.56, 0.82]
    hinge: right
  unit:
    kind: drawers
    place: kitchen
    center_m: [2.15, 3.7]
    size_m: [1.0, 0.56, 0.72]
    drawers: 3
object_kinds:
  cup: {shape: cylinder, radius_m: 0.035, height_m: 0.10, mass_kg: 0.15}
objects:
  cup_1: {kind: cup, in: unit_drawer_3, at_m: [-0.15, -0.10]}
"""


def test_what_is_open_beside_it_is_said_to_be_in_the_way_and_closed_first(tmp_path: Path) -> None:
    (tmp_path / "row.yaml").write_text(NEIGHBOURS)
    backend = MujocoBackend(load_world(tmp_path / "row.yaml"), [hsr((3.0, 2.0, 1.57))])
    do(backend, K.OPEN, object="unit_drawer_1")
    for thing in ("unit_drawer_2", "left"):
        outcome = run(backend, K.OPEN, object=thing)
        assert outcome.state is MotionState.FAILED
        assert outcome.blocked_by == "unit_drawer_1", outcome.reason
    do(backend, K.CLOSE, object="unit_drawer_1")
    do(backend, K.OPEN, object="left")
    do(backend, K.CLOSE, object="left")
    do(backend, K.OPEN, object="unit_drawer_3")
    take(backend, "cup_1")
    assert touched(backend) == 0


@pytest.mark.parametrize("seed", range(4))
def test_an_arm_on_two_wheels_opens_and_closes_what_it_cannot_drive_along_with(
    tmp_path: Path, seed: int
) -> None:
    chance = random.Random(seed)
    start = (chance.uniform(1.5, 4.0), chance.uniform(1.6, 3.2), chance.uniform(-3.0, 3.0))
    spec = wheeled_arm(tmp_path)
    backend = MujocoBackend(furnished(tmp_path), [(spec, start)], seed, {spec.robot: tmp_path})
    for thing in ("cupboard", "dresser_drawer_1"):
        for kind, is_open in ((K.OPEN, True), (K.CLOSE, False)):
            do(backend, kind, spec.robot, object=thing)
            assert truth(backend, thing).states == {"is_open": is_open}
    assert touched(backend) == 0
