"""Tasks in COHERENT's form, planned by us and carried out by the set's rules."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest

from benchmarks.public.coherent import Result, carried_out, others, planned, rows_of
from benchmarks.public.graph_rules import Situation
from benchmarks.public.scene_graph import tasks_in
from fleet.service.composition import Composition, compose
from tests.support.scene_graphs import (
    BASKET,
    BENCH,
    CHEST,
    COUNTER,
    DOOR,
    EDGES,
    HALL_FLOOR,
    JAR,
    NODES,
    PEN,
    QUADROTOR,
    STUDY_FLOOR,
    VASE,
    task_row,
    written,
)

LIMIT_S = 120.0


@pytest.fixture(scope="module")
def parts() -> Composition:
    return compose()


@pytest.mark.parametrize(
    ("goal", "steps"),
    [
        ([(PEN, "ON", BENCH)], 6),
        ([(VASE, "INSIDE", JAR)], 2),
        ([(QUADROTOR, "ON", COUNTER)], 6),
        # The door, a landing, the arm, the way back, and the dog once more.
        ([(VASE, "ON", BENCH)], 15),
        ([(PEN, "INSIDE", BASKET), (QUADROTOR, "ON", COUNTER)], 12),
        ([(VASE, "INSIDE", BASKET), (QUADROTOR, "ON", HALL_FLOOR)], 11),
    ],
)
def test_a_task_takes_the_fewest_steps(
    goal: list[tuple[int, str, int]], steps: int, tmp_path: Path
) -> None:
    (task,) = tasks_in(written(tmp_path, task_row(goal, steps)))
    result = carried_out(task, LIMIT_S)
    assert (result.steps, result.why) == (steps, "")


def test_what_cannot_be_done_by_the_sets_rules_is_told_apart(tmp_path: Path) -> None:
    (task,) = tasks_in(written(tmp_path, task_row([(BENCH, "ON", COUNTER)], 5)))
    result = carried_out(task, LIMIT_S)
    assert (result.steps, result.why) == (
        None,
        "by the set's own rules nobody takes <bench>(20): it is not GRABABLE",
    )


def test_more_than_twice_the_reference_is_no_success(tmp_path: Path) -> None:
    (task,) = tasks_in(written(tmp_path, task_row([(PEN, "ON", BENCH)], 2)))
    assert carried_out(task, LIMIT_S).why == "6 steps are more than twice the reference's"


@pytest.mark.parametrize("seed", range(6))
def test_whatever_lies_where_every_step_is_allowed(
    seed: int, tmp_path: Path, parts: Composition
) -> None:
    chance = Random(seed)
    spots = {BENCH: "ON", COUNTER: "ON", CHEST: "INSIDE", BASKET: "INSIDE", STUDY_FLOOR: "ON"}
    edges = [edge for edge in EDGES if edge[0] not in (PEN, VASE)]
    low = {
        id_: [p for p in properties if p != "ON_HIGH_SURFACE"] for id_, _, _, properties, _ in NODES
    }
    for thing in (PEN, VASE):
        where = chance.choice(sorted(spots))
        edges.append((thing, spots[where], where))
        low[thing] += ["ON_HIGH_SURFACE"] * (where == COUNTER)
    low[JAR].append("ON_HIGH_SURFACE")
    door = chance.choice(["OPEN", "CLOSED"])
    nodes = [
        (id_, category, name, low[id_], [door] if id_ == DOOR else states)
        for id_, category, name, _, states in NODES
    ]
    goal = [
        (thing, spots[where], where)
        for thing, where in ((PEN, chance.choice([BENCH, BASKET])), (VASE, COUNTER))
    ]
    row = task_row(goal, 40, nodes=nodes, edges=edges)
    (task,) = tasks_in(written(tmp_path, row))
    steps = planned(task, parts, LIMIT_S)
    assert not isinstance(steps, str), steps
    situation = Situation.first(task)
    for step in steps:
        situation = situation.after(step)
    assert situation.holds(task.goal)


def test_the_page_counts_the_steps_of_what_succeeded() -> None:
    results = [
        Result("env1", 0, 5, 5, 0.5),
        Result("env1", 1, 9, None, 1.5, "why"),
        Result("env2", 0, 7, 8, 2.5),
    ]
    assert rows_of(results) == [
        ("env1", "2", "1/2", "5 (5.00 each)", "5 (5.00 each)", "1.50 s", "1.50 s"),
        ("env2", "1", "1/1", "8 (8.00 each)", "7 (7.00 each)", "2.50 s", "2.50 s"),
        ("all", "3", "2/3", "13 (6.50 each)", "12 (6.00 each)", "1.50 s", "2.50 s"),
    ]
    assert others(results) == [("env1-1", "none", "9", "why"), ("env2-0", "8", "7", "")]
