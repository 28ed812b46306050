"""What the physics says of things in drawers: hands get at them from above, or say why not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest

from keyexpr_schema.payloads.motions import Motion, MotionKind, MotionOutcome, MotionState
from sim.files.robot_file import load_robot
from sim.files.world_file import load_world
from sim.mujoco_world import MujocoBackend

APARTMENT = Path("configs/worlds/apartment.yaml")
STARTS = {"kitchen": (2.4, 7.0, 1.5), "bedroom": (4.6, 2.4, 0.0), "study": (9.6, 2.2, 0.0)}


def with_a(
    folder: Path, kind: str, inside: str, at_m: tuple[float, float], robot: str, place: str
) -> MujocoBackend:
    """The apartment's furniture, a thing of a kind in a part of it, and a robot in its room."""
    head, _, _ = APARTMENT.read_text().partition("\nobjects:")
    thing = f"  thing: {{kind: {kind}, in: {inside}, at_m: [{at_m[0]}, {at_m[1]}]}}\n"
    path = folder / "apartment.yaml"
    path.write_text(f"{head}\nobjects:\n{thing}")
    spec = msgspec.structs.replace(load_robot(robot), robot=robot)
    return MujocoBackend(load_world(path), [(spec, STARTS[place])])


def do(backend: MujocoBackend, robot: str, kind: MotionKind, **fields: Any) -> MotionOutcome:
    backend.begin(robot, Motion(kind=kind, **fields))
    while backend.is_running(robot):
        backend.advance()
    outcome = backend.outcome(robot)
    assert outcome is not None
    return outcome


def taken(backend: MujocoBackend, robot: str, drawer: str) -> MotionOutcome:
    """How the last motion ended of opening a drawer and taking the thing out, at the first try."""
    outcome = do(backend, robot, MotionKind.OPEN, object=drawer)
    for kind in (MotionKind.APPROACH, MotionKind.GRASP):
        if outcome.state is MotionState.SUCCEEDED:
            point = backend.truths()[0].point_m
            outcome = do(backend, robot, kind, object="thing", point_m=point)
    return outcome


DEEP = [
    ("kitchen_unit_drawer_2", "kitchen", "spoon", (0.18, -0.06), "hsr"),
    ("kitchen_unit_drawer_3", "kitchen", "cup", (0.0, -0.15), "hsr"),
    ("dresser_drawer_1", "bedroom", "spoon", (0.155, -0.01), "hsr"),
    ("dresser_drawer_2", "bedroom", "cup", (-0.155, -0.01), "butler"),
    ("dresser_drawer_3", "bedroom", "spoon", (0.31, -0.1), "butler"),
    ("filing_cabinet_drawer_1", "study", "folder", (0.0, -0.1), "butler"),
    ("filing_cabinet_drawer_2", "study", "spoon", (0.055, -0.01), "hsr"),
]


@pytest.mark.parametrize(("drawer", "place", "kind", "at_m", "robot"), DEEP)
def test_a_thing_is_taken_out_of_a_drawer_at_the_first_try(
    tmp_path: Path, drawer: str, place: str, kind: str, at_m: tuple[float, float], robot: str
) -> None:
    backend = with_a(tmp_path, kind, drawer, at_m, robot, place)
    outcome = taken(backend, robot, drawer)
    assert outcome.state is MotionState.SUCCEEDED, outcome.reason
    assert backend.truths()[0].held_by == robot
    contacts = backend.contacts()
    assert (contacts.robot_robot, contacts.robot_wall) == (0, 0)


def test_who_stands_beside_a_lamp_stays_clear_of_the_bracket_of_its_button(
    tmp_path: Path,
) -> None:
    drawer = "nightstand_drawer_1"
    backend = with_a(tmp_path, "spoon", drawer, (-0.055, 0.01), "hsr", "bedroom")
    assert taken(backend, "hsr", drawer).state is MotionState.SUCCEEDED
    assert backend.contacts().robot_wall == 0


def test_what_lies_too_far_back_in_a_drawer_is_out_of_reach_and_closing_that_is_no_help(
    tmp_path: Path,
) -> None:
    drawer = "kitchen_unit_drawer_1"
    backend = with_a(tmp_path, "spoon", drawer, (0.18, 0.1), "hsr", "kitchen")
    outcome = taken(backend, "hsr", drawer)
    assert outcome.state is MotionState.FAILED
    assert outcome.reason == f"thing in {drawer} is out of reach of hsr"
    assert outcome.blocked_by is None and not outcome.retryable
