"""The history: pages of it, and what it comes to."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from fleet.history.archive import Archive
from fleet.history.queries import covered_s, page, percentile, stats
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.history import HistoryOutcome, HistoryQuery, HistoryStatsQuery
from keyexpr_schema.payloads.plans import PlanState
from tests.support.past_records import DAY_S, past_goal, past_plan, past_request

FAILED = HistoryOutcome.FAILED
REACHED = HistoryOutcome.REACHED


@pytest.fixture
def archive(tmp_path: Path) -> Iterator[Archive]:
    with Archive(tmp_path) as opened:
        opened.add(
            [
                past_plan("plan-1", past_goal("g1", ended_s=10.0), busy_s=10.0),
                past_request("r1"),
                past_plan(
                    "plan-2",
                    past_goal("g2", GoalState.FAILED, reason="it slipped", wall_s=DAY_S),
                    past_goal("g3", ended_s=30.0, wall_s=DAY_S),
                    state=PlanState.FAILED,
                    robot="locobot",
                    begun_s=100.0,
                    busy_s=5.0,
                    wall_s=DAY_S,
                    revision=3,
                ),
                past_goal("g4", GoalState.WAITING, deleted=True, wall_s=DAY_S),
            ]
        )
        yield opened


def names(archive: Archive, **query: object) -> list[str]:
    with archive.reading() as db:
        found = page(db, HistoryQuery(**query))  # type: ignore[arg-type]
    return [entry.plan or entry.goals[0].goal for entry in found.entries]


def test_the_newest_comes_first_and_requests_are_not_shown(archive: Archive) -> None:
    assert names(archive) == ["g4", "plan-2", "plan-1"]


def test_of_a_goal_not_all_that_is_over_is_gone_through(archive: Archive) -> None:
    asked: list[str] = []
    with archive.reading() as db:
        db.set_trace_callback(asked.append)
        page(db, HistoryQuery(goal="g3"))
        db.set_trace_callback(None)
        steps = [step for sql in asked for *_, step in db.execute(f"EXPLAIN QUERY PLAN {sql}")]
    assert steps
    assert not any(step == "SCAN ended" or step.endswith("(kind=?)") for step in steps)


def test_what_is_asked_for_is_filtered(archive: Archive) -> None:
    assert names(archive, goal="g3") == ["plan-2"]
    assert names(archive, robot="hsr") == ["plan-1"]
    assert names(archive, since_wall_s=DAY_S) == ["g4", "plan-2"]
    assert names(archive, robot="hsr", since_wall_s=DAY_S) == []


def test_what_a_goal_has_made_is_about_it(tmp_path: Path) -> None:
    with Archive(tmp_path / "runs") as archive:
        made = ("g.1", "gg", "g.12", "h.1", "g")
        archive.add([past_plan(f"p{n}", past_goal(name)) for n, name in enumerate(made)])
        assert names(archive, goal="g") == ["p4", "p2", "p0"]
        assert names(archive, goal="g.1") == ["p0"]


def test_a_plan_that_a_deleted_goal_was_taken_from_is_about_it(archive: Archive) -> None:
    running = {"state": GoalState.RUNNING, "deleted": True}
    archive.add([past_goal("g5.1", plan="plan-7", **running), past_goal("g6", **running)])  # type: ignore[arg-type]
    archive.add([past_plan("plan-7", state=PlanState.CANCELLED), past_plan("plan-8")])
    assert names(archive, goal="g5") == names(archive, goal="g5.1") == ["plan-7", "g5.1"]
    assert names(archive, goal="g6") == ["g6"]
    assert names(archive, goal="g5", robot="locobot") == []


def test_pages_together_are_the_whole(archive: Archive) -> None:
    found, before = [], None
    with archive.reading() as db:
        for _ in range(3):
            part = page(db, HistoryQuery(limit=1, before=before))
            found += part.entries
            before = part.before
        assert before is None
        assert tuple(found) == page(db, HistoryQuery()).entries


def test_an_entry_says_what_was_wanted_what_came_of_it_and_who_did_it(archive: Archive) -> None:
    with archive.reading() as db:
        (entry,) = page(db, HistoryQuery(goal="g2")).entries
    assert entry.outcome is FAILED
    assert [(goal.text, goal.outcome, goal.reason) for goal in entry.goals] == [
        ("Do g2.", FAILED, "it slipped"),
        ("Do g3.", REACHED, None),
    ]
    assert entry.goals[1].took_s == 30.0
    assert [(share.robot, share.tasks, share.busy_s) for share in entry.robots] == [
        ("locobot", 1, 5.0)
    ]
    assert (entry.replans, entry.tasks) == (2, 1)
    assert (entry.begun_s, entry.ended_s) == (100.0, 120.0)


def test_the_history_is_added_up_as_a_whole_and_by_day(archive: Archive) -> None:
    with archive.reading() as db:
        found = stats(db, HistoryStatsQuery())
    assert [day.day for day in found.days] == ["1970-01-01", "1970-01-02"]
    total = found.total
    assert total.goals == {REACHED: 2, FAILED: 1, HistoryOutcome.DELETED: 1}
    assert total.plans == {HistoryOutcome.SUCCEEDED: 1, FAILED: 1}
    assert [(each.reason, each.goals) for each in total.failures] == [("it slipped", 1)]
    assert (total.median_s, total.p90_s) == (20.0, 30.0)
    assert total.replans == 2
    assert total.active_s == 40.0
    assert [(use.robot, use.busy_s, use.utilisation) for use in total.robots] == [
        ("hsr", 10.0, 0.25),
        ("locobot", 5.0, 0.125),
    ]
    first = found.days[0]
    assert first.goals == {REACHED: 1}
    assert [(use.robot, use.utilisation) for use in first.robots] == [("hsr", 0.5)]


def test_days_are_those_of_the_place_that_asks(archive: Archive) -> None:
    with archive.reading() as db:
        found = stats(db, HistoryStatsQuery(utc_offset_s=-3600, since_wall_s=1.0))
    assert [day.day for day in found.days] == ["1969-12-31", "1970-01-01"]


@pytest.mark.parametrize(
    ("spans", "covered"),
    [
        ([], 0.0),
        ([(0.0, 10.0), (5.0, 20.0)], 20.0),
        ([(0.0, 10.0), (2.0, 3.0), (20.0, 25.0)], 15.0),
        ([(100.0, 150.0), (0.0, 10.0), (5.0, 12.0)], 62.0),  # the clock began again
    ],
)
def test_time_that_plans_share_counts_once(
    spans: list[tuple[float, float]], covered: float
) -> None:
    assert covered_s(spans) == covered


@pytest.mark.parametrize(
    ("values", "p90"),
    [([], None), ([7.0], 7.0), ([float(n) for n in range(1, 11)], 9.0), ([3.0, 1.0], 3.0)],
)
def test_the_nearest_rank(values: list[float], p90: float | None) -> None:
    assert percentile(values, 0.9) == p90
