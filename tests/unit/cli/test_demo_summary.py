"""What a demo comes to: times of robots and the order of tasks."""

from __future__ import annotations

from io import StringIO

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from cli.demo.summary import Summary, task_lines, times
from cli.demo.verdict import GoalVerdict, Verdict
from cli.views.demo_summary import summary_page
from fleet.scheduling.idle_time import union_s
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState, Try


def record(
    task: str,
    robot: str,
    start_s: float | None,
    end_s: float | None,
    ordered_s: float | None = None,
    tries: tuple[Try, ...] = (),
) -> TaskRecord:
    return TaskRecord(
        plan="p",
        revision=1,
        task=task,
        skill="navigate",
        args={"place": "kitchen"},
        actor="a",
        robot=robot,
        state=TaskState.SUCCEEDED,
        tries=tries,
        ordered_s=ordered_s,
        started_s=start_s,
        ended_s=end_s,
    )


def test_makespan_runs_from_the_first_order_and_idle_is_the_rest() -> None:
    records = [
        record("t1", "hsr", 12.0, 20.0, ordered_s=10.0),
        record("t2", "hsr", 25.0, 40.0, ordered_s=20.0),
        record("t3", "locobot", 11.0, 21.0, ordered_s=10.0),
    ]
    makespan_s, busy_s, idle_s = times(records, ["hsr", "locobot", "spare"])
    assert makespan_s == pytest.approx(30.0)
    assert busy_s == pytest.approx({"hsr": 23.0, "locobot": 10.0, "spare": 0.0})
    assert idle_s == pytest.approx({"hsr": 7.0, "locobot": 20.0, "spare": 30.0})


def test_tries_of_an_earlier_attempt_count_as_busy() -> None:
    tries = (Try(number=1, started_s=0.0, ended_s=4.0, reason="slipped"),)
    _, busy_s, _ = times([record("t1", "hsr", 6.0, 8.0, 0.0, tries)], ["hsr"])
    assert busy_s["hsr"] == pytest.approx(6.0)


def test_a_plan_that_never_started_took_no_time() -> None:
    assert times([record("t1", "hsr", None, None)], ["hsr"]) == (0.0, {"hsr": 0.0}, {"hsr": 0.0})


def test_lines_are_in_order_of_start_and_those_that_never_started_last() -> None:
    records = [
        record("t1", "hsr", None, None),
        record("t2", "hsr", 5.0, 6.5),
        record("t3", "hsr", 1.0, None),
    ]
    lines = task_lines(records)
    assert [line.task for line in lines] == ["t3", "t2", "t1"]
    assert [line.duration_s for line in lines] == [None, 1.5, None]


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(0, 50))))
def test_the_union_of_intervals_counts_every_unit_once(pairs: list[tuple[int, int]]) -> None:
    spans = [(float(min(pair)), float(max(pair))) for pair in pairs]
    units = {unit for start, end in spans for unit in range(int(start), int(end))}
    assert union_s(spans) == len(units)


def verdict(goal: str, physics: Verdict, planner: GoalState) -> Verdict:
    agreed = physics is Verdict.HOLDS and planner is GoalState.REACHED
    return GoalVerdict(
        goal=goal, physics=physics, planner=planner, agreed=agreed, sentence="so", conditions=()
    )


def page_of(*verdicts: Verdict) -> str:
    summary = Summary(
        mission="m",
        backend="mujoco",
        ok=all(each.agreed for each in verdicts),
        goals=verdicts,
        tasks=(),
        revisions={},
        makespan_s=0.0,
        busy_s={},
        idle_s={},
        contacts=None,
        wall_s=1.0,
        real_time_factor=None,
        out="runs/m",
        recording=None,
    )
    console = Console(width=160, file=StringIO())
    console.print(summary_page(summary))
    return console.file.getvalue()  # type: ignore[attr-defined,no-any-return]


def test_the_title_tells_a_failure_from_what_physics_cannot_see() -> None:
    holds = verdict("bring", Verdict.HOLDS, GoalState.REACHED)
    unseen = verdict("search-all", Verdict.NOT_JUDGED, GoalState.REACHED)
    failed = verdict("fetch", Verdict.FAILS, GoalState.REACHED)
    assert "Every goal is reached: the physics and the planner agree." in page_of(holds)
    assert "the physics cannot see all of it" in page_of(holds, unseen)
    assert "Not every goal is reached" in page_of(holds, unseen, failed)
    lines = [line for line in page_of(holds, unseen).splitlines() if "planner:" in line]
    assert lines[0].index("physics:") == lines[1].index("physics:")
