"""The world without physics: what opens, what is switched, what is on and in what."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from keyexpr_schema.payloads.motions import Motion, MotionKind, MotionOutcome, MotionState
from keyexpr_schema.payloads.simulation import Truth
from keyexpr_schema.payloads.world import Feature
from sim.files.world_payloads import object_payloads
from sim.kinematic.backend import KinematicBackend
from tests.support.furnished import furnished, hsr

K = MotionKind


@pytest.fixture
def flat(tmp_path: Path) -> KinematicBackend:
    return KinematicBackend(furnished(tmp_path), [hsr(), hsr((6.5, 2.5, 0.0), "other")])


def run(backend: KinematicBackend, kind: MotionKind, **fields: Any) -> MotionOutcome:
    who = fields.pop("who", "hsr")
    backend.begin(who, Motion(kind=kind, **fields))
    while True:
        outcome = backend.outcome(who)
        assert outcome is not None
        if outcome.state is not MotionState.RUNNING:
            return outcome
        backend.advance()


def do(backend: KinematicBackend, kind: MotionKind, **fields: Any) -> MotionOutcome:
    outcome = run(backend, kind, **fields)
    assert outcome.state is MotionState.SUCCEEDED, outcome.reason
    return outcome


def refused(backend: KinematicBackend, kind: MotionKind, **fields: Any) -> str:
    outcome = run(backend, kind, **fields)
    assert outcome.state is MotionState.FAILED
    return outcome.reason or ""


def truth(backend: KinematicBackend, name: str) -> Truth:
    return next(truth for truth in backend.truths() if truth.object == name)


def take(backend: KinematicBackend, name: str) -> None:
    point = truth(backend, name).point_m
    do(backend, K.APPROACH, point_m=point)
    do(backend, K.GRASP, object=name, point_m=point)


def test_furniture_and_its_parts_are_things_that_do_not_move(tmp_path: Path) -> None:
    things = {thing.object: thing for thing in object_payloads(furnished(tmp_path))}
    assert things["cupboard"].features == (Feature.CONTAINS, Feature.OPENABLE)
    assert things["dresser"].features == (Feature.SUPPORTS,)
    drawer = things["dresser_drawer_1"]
    assert (drawer.part_of, drawer.kind, drawer.label) == (
        "dresser",
        "drawer",
        "first drawer of the dresser",
    )
    assert drawer.features == (Feature.CONTAINS, Feature.OPENABLE)
    assert things["bookcase_board_2"].features == (Feature.SUPPORTS,)
    assert things["oven"].features == (Feature.SUPPORTS, Feature.SWITCHABLE)
    assert things["anna"].features == (Feature.PERSON,)
    assert things["mug_1"].categories == ("cup",)
    assert things["bowl_1"].features == (Feature.CONTAINS,)
    assert [n for n, t in things.items() if t.is_a(Feature.MOVABLE)] == [
        "cup_1",
        "mug_1",
        "bowl_1",
        "spoon_1",
    ]
    assert (things["cupboard"].home, things["anna"].home) == ("kitchen", "hall")


def test_what_is_closed_in_is_neither_seen_nor_taken_until_it_is_opened(
    flat: KinematicBackend,
) -> None:
    seen = {one.object: one for one in do(flat, K.LOOK).detections}
    assert {"mug_1", "bowl_1", "cupboard"} <= set(seen)
    assert not {"cup_1", "spoon_1", "anna"} & set(seen)
    assert seen["cupboard"].states == {"is_open": False}
    inside = truth(flat, "cup_1").point_m
    do(flat, K.APPROACH, point_m=inside)
    assert "in cupboard, which is closed" in refused(flat, K.GRASP, object="cup_1", point_m=inside)
    do(flat, K.OPEN, object="cupboard")
    assert truth(flat, "cupboard").states == {"is_open": True}
    assert next(d for d in do(flat, K.LOOK).detections if d.object == "cup_1").support == "cupboard"
    take(flat, "cup_1")
    assert "the hand is not empty" in refused(flat, K.CLOSE, object="cupboard")


def test_what_lies_in_a_drawer_comes_out_with_it(flat: KinematicBackend) -> None:
    before = truth(flat, "spoon_1").point_m
    do(flat, K.OPEN, object="dresser_drawer_1")
    after = truth(flat, "spoon_1")
    assert before[1] - after.point_m[1] == pytest.approx(0.38)
    assert after.support == "dresser_drawer_1"


def test_a_bowl_takes_along_what_is_in_it(flat: KinematicBackend) -> None:
    take(flat, "mug_1")
    do(flat, K.PLACE_AT, object="bowl_1")
    assert truth(flat, "mug_1").support == "bowl_1"
    take(flat, "bowl_1")
    mug = truth(flat, "mug_1")
    assert (mug.support, mug.held_by) == ("bowl_1", None)
    assert truth(flat, "bowl_1").held_by == "hsr"
    assert "in itself" in refused(flat, K.PLACE_AT, object="bowl_1")
    do(flat, K.PLACE_AT, object="bookcase_board_2")
    assert truth(flat, "bowl_1").support == "bookcase_board_2"
    assert truth(flat, "mug_1").place == "hall"


def test_a_person_takes_one_thing(flat: KinematicBackend) -> None:
    take(flat, "mug_1")
    do(flat, K.HAND_OVER, object="anna")
    mug = truth(flat, "mug_1")
    assert (mug.support, mug.place, mug.held_by) == ("anna", "hall", None)
    take(flat, "bowl_1")
    assert "no room at anna" in refused(flat, K.HAND_OVER, object="anna")


def test_a_process_takes_its_time_and_only_while_it_is_on(flat: KinematicBackend) -> None:
    take(flat, "mug_1")
    do(flat, K.PLACE_AT, object="oven")
    for _ in range(600):
        flat.advance()
    assert truth(flat, "mug_1").states == {}
    do(flat, K.SWITCH_ON, object="oven")
    assert truth(flat, "oven").states == {"is_on": True}
    begun_s = flat.time_s
    while truth(flat, "mug_1").states != {"temperature": "hot"}:
        flat.advance()
        assert flat.time_s < begun_s + 21.0
    assert flat.time_s >= begun_s + 19.9
    do(flat, K.SWITCH_OFF, object="oven")
    assert truth(flat, "oven").states == {"is_on": False}
    assert truth(flat, "mug_1").states == {"temperature": "hot"}


@pytest.mark.parametrize(
    ("kind", "thing", "said"),
    [
        (K.OPEN, "table", "table is not something to open; there are cupboard, dresser_drawer_1"),
        (K.SWITCH_ON, "cup_1", "cup_1 is not something to switch on; there are oven, lamp"),
        (K.HAND_OVER, "table", "table is not something to give things to; there are anna"),
        (K.GRASP, "anna", "anna is not something to take up"),
        (K.PLACE_AT, "cupboard", "the hand is empty"),
    ],
)
def test_what_makes_no_sense_is_refused_with_what_would(
    flat: KinematicBackend, kind: MotionKind, thing: str, said: str
) -> None:
    point = (1.0, 1.0, 0.0) if kind is K.GRASP else None
    assert said in refused(flat, kind, object=thing, point_m=point)


def test_doors_and_drawers_are_drawn_as_they_stand(flat: KinematicBackend) -> None:
    """Where the middle of a handle is drawn is where it is when that is open."""

    def handle(thing: str) -> tuple[float, ...]:
        fixture, mover = flat.world.fixtures.movers[thing]
        name = f"{fixture.name}/{thing}"
        assert name in {body.body for body in flat.scene().bodies}
        (x, y, z), (w, _, _, turned) = flat.frame().poses[name]
        yaw = 2 * math.atan2(turned, w)
        a, b, up = mover.handle_m
        c, s = math.cos(yaw), math.sin(yaw)
        return (x + c * a - s * b, y + s * a + c * b, z + up)

    for thing in ("cupboard", "dresser_drawer_1"):
        _, mover = flat.world.fixtures.movers[thing]
        for kind, share in ((K.OPEN, 1.0), (K.CLOSE, 0.0)):
            do(flat, kind, object=thing)
            stands = flat.world.fixtures.moved_m(thing, mover.handle_m, share)
            assert handle(thing) == pytest.approx(stands)


def test_a_drawer_is_not_reached_under_one_that_is_open(flat: KinematicBackend) -> None:
    do(flat, K.OPEN, object="dresser_drawer_1")
    flat.begin("hsr", Motion(kind=K.OPEN, object="dresser_drawer_2"))
    while flat.is_running("hsr"):
        flat.advance()
    outcome = flat.outcome("hsr")
    assert outcome is not None and outcome.blocked_by == "dresser_drawer_1"
    assert outcome.reason == "dresser_drawer_1, which is open, is in the way of dresser_drawer_2"
    do(flat, K.CLOSE, object="dresser_drawer_1")
    do(flat, K.OPEN, object="dresser_drawer_2")
