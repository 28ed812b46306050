"""The rules of COHERENT's robots: what each may do, and what that does to the graph."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.public.errors import BadTaskFile, IllegalStep
from benchmarks.public.graph_rules import (
    CLOSES,
    GRAB,
    LAND_ON,
    MOVE,
    OPENS,
    PUT_INTO,
    PUT_ON,
    TAKE_OFF,
    Situation,
    Step,
)
from benchmarks.public.scene_graph import Edge, tasks_in
from tests.support.scene_graphs import (
    ARM,
    BASKET,
    BENCH,
    CHEST,
    COUNTER,
    DOG,
    DOOR,
    EDGES,
    HALL,
    HALL_FLOOR,
    JAR,
    PEN,
    QUADROTOR,
    STUDY,
    STUDY_FLOOR,
    VASE,
    task_row,
    written,
)


@pytest.fixture
def first(tmp_path: Path) -> Situation:
    (task,) = tasks_in(written(tmp_path, task_row([(PEN, "ON", BENCH)], 6)))
    return Situation.first(task)


def dog(action: str, thing: int, onto: int | None = None) -> Step:
    return Step(DOG, action, thing, onto)


def after(situation: Situation, *steps: Step) -> Situation:
    for step in steps:
        situation = situation.after(step)
    return situation


def test_a_dog_sees_and_takes_what_is_in_a_chest_once_that_is_open(first: Situation) -> None:
    assert PEN not in first.visible(DOG)
    opened = after(first, dog(MOVE, CHEST), dog(OPENS, CHEST))
    assert PEN in opened.visible(DOG)
    # It came to the chest while that was closed, so that it is not close to what is in it.
    with pytest.raises(IllegalStep, match="may not 10: grab"):
        opened.after(dog(GRAB, PEN))
    took = after(opened, dog(MOVE, PEN), dog(GRAB, PEN))
    assert took.of(DOG, "HOLD") == [PEN]
    put = after(took, dog(MOVE, BENCH), dog(PUT_ON, PEN, BENCH))
    assert put.holds([Edge(PEN, "ON", BENCH)])
    assert put.of(PEN, "ON", "INSIDE") == [BENCH]


def test_what_is_beside_an_open_container_is_in_reach_with_it(first: Situation) -> None:
    shut = after(first, dog(MOVE, CHEST), dog(OPENS, CHEST), dog(MOVE, BENCH))
    assert shut.after(dog(MOVE, CHEST)).of(DOG, "CLOSE") == [CHEST, PEN]


def test_a_full_hand_opens_nothing(first: Situation) -> None:
    took = after(first, *(dog(MOVE, CHEST), dog(OPENS, CHEST), dog(MOVE, PEN), dog(GRAB, PEN)))
    with pytest.raises(IllegalStep):
        took.after(dog(CLOSES, CHEST))
    with pytest.raises(IllegalStep):
        took.after(dog(MOVE, DOOR)).after(dog(OPENS, DOOR))


def test_nobody_goes_through_a_closed_door(first: Situation) -> None:
    with pytest.raises(IllegalStep):
        first.after(dog(MOVE, STUDY))
    opened = after(first, dog(MOVE, DOOR), dog(OPENS, DOOR))
    there = opened.after(dog(MOVE, STUDY))
    assert (there.room(DOG), there.of(DOG, "ON"), there.of(DOG, "CLOSE")) == (
        STUDY,
        [STUDY_FLOOR],
        [],
    )
    flown = after(opened, Step(QUADROTOR, TAKE_OFF, HALL_FLOOR), Step(QUADROTOR, MOVE, STUDY))
    assert flown.of(QUADROTOR, "ABOVE") == [STUDY_FLOOR]


def test_what_is_high_is_for_the_arm_and_not_for_the_dog(first: Situation) -> None:
    there = after(first, dog(MOVE, DOOR), dog(OPENS, DOOR), dog(MOVE, STUDY))
    for high in (COUNTER, VASE):
        with pytest.raises(IllegalStep):
            there.after(dog(MOVE, high))
    put = after(there, Step(ARM, GRAB, VASE), Step(ARM, PUT_INTO, VASE, JAR))
    assert put.of(VASE, "INSIDE") == [JAR]
    with pytest.raises(IllegalStep):
        put.after(Step(ARM, GRAB, PEN))


def test_what_is_in_a_basket_comes_along_and_is_as_high_as_that(first: Situation) -> None:
    opened = after(first, dog(MOVE, DOOR), dog(OPENS, DOOR))
    above = after(opened, Step(QUADROTOR, TAKE_OFF, HALL_FLOOR), Step(QUADROTOR, MOVE, STUDY))
    with pytest.raises(IllegalStep):
        above.after(Step(QUADROTOR, LAND_ON, COUNTER))
    landed = after(above, Step(QUADROTOR, MOVE, COUNTER), Step(QUADROTOR, LAND_ON, COUNTER))
    loaded = after(landed, Step(ARM, GRAB, VASE), Step(ARM, PUT_INTO, VASE, BASKET))
    home = after(loaded, Step(QUADROTOR, TAKE_OFF, COUNTER), Step(QUADROTOR, MOVE, HALL))
    with pytest.raises(IllegalStep):
        home.after(dog(MOVE, VASE))
    down = after(home, Step(QUADROTOR, LAND_ON, HALL_FLOOR), dog(MOVE, VASE), dog(GRAB, VASE))
    assert down.of(DOG, "HOLD") == [VASE]


def test_a_basket_that_has_flown_off_is_not_close_any_more(first: Situation) -> None:
    beside = first.after(dog(MOVE, BASKET))
    assert beside.of(DOG, "CLOSE") == [BASKET]
    again = after(
        beside, Step(QUADROTOR, TAKE_OFF, HALL_FLOOR), Step(QUADROTOR, LAND_ON, HALL_FLOOR)
    )
    assert again.of(DOG, "CLOSE") == []


def test_what_can_never_be_is_told(tmp_path: Path) -> None:
    rows = [
        task_row([(BENCH, "ON", COUNTER)], 5, 0),
        task_row([(PEN, "INSIDE", BENCH)], 5, 1),
        task_row([(QUADROTOR, "ON", COUNTER)], 5, 2),
    ]
    why = [Situation.first(t).never(t.goal) for t in tasks_in(written(tmp_path, *rows))]
    assert why == [
        "by the set's own rules nobody takes <bench>(20): it is not GRABABLE",
        "by the set's own rules nothing is put there: <bench>(20) is not CONTAINERS",
        "",
    ]


def test_a_file_that_is_not_as_the_sets_are_is_told(tmp_path: Path) -> None:
    with pytest.raises(BadTaskFile, match="there are no files env"):
        tasks_in(tmp_path)
    with pytest.raises(BadTaskFile, match=r"task 0: relations speak of \[99\], which are no nodes"):
        row = task_row([(PEN, "ON", BENCH)], 1, edges=[*EDGES, (99, "ON", BENCH)])
        tasks_in(written(tmp_path, row))
    bad = {**task_row([], 1), "task_goal": {"near_<pen>(30)_<bench>(20)": [1, []]}}
    with pytest.raises(BadTaskFile, match="is no goal such as"):
        tasks_in(written(tmp_path, bad))
    tmp_path.joinpath("env7.json").write_text("[{}]", encoding="utf-8")
    with pytest.raises(BadTaskFile, match=r"env7\.json: Object missing required field"):
        tasks_in(tmp_path)
