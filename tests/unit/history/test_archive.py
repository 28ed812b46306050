"""The archive: what it keeps, finds again, and says of keys."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from msgspec.structs import replace

from fleet.errors import StoreError
from fleet.history.archive import FILE, GOAL, PLAN, REQUEST, Archive
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.history import HistoryOutcome
from keyexpr_schema.payloads.plans import Plan, PlanState
from tests.support.open_files import nothing_stays_open
from tests.support.past_records import past_goal, past_plan, past_request


@pytest.fixture
def archive(tmp_path: Path) -> Iterator[Archive]:
    with Archive(tmp_path) as opened:
        yield opened


def test_what_is_over_is_found_by_name(archive: Archive) -> None:
    goal = past_goal("g1")
    archive.add([past_plan("plan-1", goal), past_request("r1")])
    entry = archive.plan("plan-1")
    assert entry is not None
    assert entry.outcome is HistoryOutcome.SUCCEEDED
    assert archive.goal("g1") == goal.spec
    assert archive.answered("r1")
    assert archive.plan("plan-2") is None
    assert archive.goal("g2") is None
    assert not archive.answered("r2")


def test_the_same_record_comes_twice_and_is_kept_once(archive: Archive, tmp_path: Path) -> None:
    record = past_plan("plan-1", past_goal("g1"))
    archive.add([record])
    archive.settle(record)
    archive.add([record, past_request("r1")])
    assert archive.unsettled() == [past_request("r1")]
    with archive.reading() as db:
        assert db.execute("SELECT count(*) FROM ended").fetchone() == (2,)
        assert db.execute("SELECT count(*) FROM goals").fetchone() == (1,)


def test_records_are_kept_all_or_none(archive: Archive) -> None:
    unwritable = past_plan("plan-1", past_goal("g1", reason="\ud800"))
    with pytest.raises(UnicodeEncodeError):
        archive.add([past_request("r1"), unwritable])
    assert not archive.answered("r1")


def test_a_plan_that_names_a_goal_twice_is_kept(archive: Archive) -> None:
    archive.add([past_plan("plan-1", past_goal("g1"), past_goal("g1"))])
    assert archive.goal("g1") is not None


def test_it_outlives_the_process(tmp_path: Path) -> None:
    record = past_plan("plan-1", past_goal("g1"))
    with Archive(tmp_path) as first:
        first.add([record])
    with Archive(tmp_path) as again:
        assert again.unsettled() == [record]


def test_what_a_dry_run_came_to_is_let_go_of_once_it_was_published(archive: Archive) -> None:
    request = past_request("r1")
    plan = Plan(plan="p", goals=(), conditions=(), tasks=())
    preview = replace(request, answer=replace(request.answer, preview=plan))
    archive.add([preview])
    assert archive.unsettled() == [preview]
    archive.settle(preview)
    assert archive.unsettled() == []
    assert archive.answered("r1")


def test_keys_of_the_oldest_are_due_beyond_a_number(archive: Archive) -> None:
    records = [past_plan(f"plan-{n}", past_goal(f"g{n}"), wall_s=float(n)) for n in range(1, 6)]
    archive.add(records)
    assert archive.due(PLAN, 2, 0.0) == []  # none has its last values on its keys yet
    for record in records[:4]:
        archive.settle(record)
    due = archive.due(PLAN, 2, 0.0)
    assert [live.name for live in due] == ["plan-1", "plan-2", "plan-3"]
    assert [live.goals for live in due] == [("g1",), ("g2",), ("g3",)]
    archive.retire(due)
    assert archive.due(PLAN, 2, 0.0) == []
    assert archive.goal("g1") is None
    assert archive.goal("g4") is not None


def test_keys_are_due_after_a_time(archive: Archive) -> None:
    records = [past_plan("plan-1", wall_s=0.0), past_plan("plan-2", wall_s=100.0)]
    archive.add(records)
    for record in records:
        archive.settle(record)
    assert [live.name for live in archive.due(PLAN, 10, 50.0)] == ["plan-1"]


def test_requests_and_goals_without_a_plan_have_their_own_number(archive: Archive) -> None:
    records = [past_goal("g1"), past_goal("g2"), past_request("r1"), past_request("r2")]
    archive.add(records)
    for record in records:
        archive.settle(record)
    assert [live.name for live in archive.due(GOAL, 1, -1.0)] == ["g1"]
    assert [live.name for live in archive.due(REQUEST, 1, -1.0)] == ["r1"]


def test_a_deleted_goal_has_no_keys(archive: Archive) -> None:
    archive.add([past_goal("g1", GoalState.RUNNING, deleted=True)])
    assert archive.goal("g1") is None
    assert archive.unsettled() == []
    assert archive.live_goals(1e12) == []
    past = archive.past_goal("g1")
    assert past is not None
    assert past.outcome is HistoryOutcome.DELETED


def test_a_goal_that_waits_again_after_its_plan_is_not_over(archive: Archive) -> None:
    waiting = past_goal("g1", GoalState.WAITING)
    archive.add([past_plan("plan-1", waiting, state=PlanState.CANCELLED)])
    assert archive.goal("g1") is None
    assert archive.past_goal("g1") is None


def test_a_goal_of_the_same_name_takes_the_keys_over(archive: Archive) -> None:
    archive.add([past_plan("plan-1", past_goal("g1"))])
    archive.retire_goal("g1")
    assert archive.goal("g1") is None
    live = archive.live_plan("plan-1")
    assert live is not None
    assert live.goals == ()


def test_parts_of_a_goal_that_have_keys_are_found_by_name(archive: Archive) -> None:
    names = ("g.1", "g.2", "g.12", "g.1.1", "g", "gg.1", "g.one")
    archive.add([past_plan(f"plan-{n}", past_goal(name)) for n, name in enumerate(names)])
    archive.retire_goal("g.2")
    assert archive.live_goals_like("g.[0-9]*") == ["g.1", "g.1.1", "g.12"]


def test_a_file_that_is_none_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(b"no database, " * 100)
    with pytest.raises(StoreError, match=r"archive .* cannot be used .*: move it away"):
        Archive(tmp_path).__enter__()


def test_an_archive_of_a_later_version_is_left_alone(tmp_path: Path) -> None:
    with Archive(tmp_path) as archive:
        archive.add([past_request("r1")])
    with closing(sqlite3.connect(tmp_path / FILE)) as db, db:
        db.execute("PRAGMA user_version = 99")
    with nothing_stays_open():
        with pytest.raises(StoreError) as refused:
            Archive(tmp_path).__enter__()
    assert "update it" in str(refused.value)
