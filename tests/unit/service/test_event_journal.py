"""The planner's event journal: order, snapshots, one planner at a time."""

from __future__ import annotations

import sqlite3
import zlib
from pathlib import Path

import msgspec
import pytest

from fleet.core.events import PlannerStarted, PlanningFailed, decode_event
from fleet.core.plan_entry import PlanEntry, PlanningJob, PlanOutcome
from fleet.core.replan_reasons import ReplanReason
from fleet.core.state import LOGIC, Policy, State
from fleet.core.step import replay, step
from fleet.service import event_journal
from fleet.service.event_journal import SNAPSHOT_FORMAT, EventJournal, JournalInUse
from keyexpr_schema.payloads.plans import PlanState
from tests.replay.journal_files import HERE, events_in
from tests.support.fleet_model import FleetModel
from tests.support.household import SKILLS, bring, carrier, manipulator


def mission() -> FleetModel:
    model = FleetModel((manipulator(), carrier()), cups=2)
    model.plan(bring(1, "hallway"), bring(2, "living_room"))
    model.finish()
    return model


def keep(folder: Path, model: FleetModel) -> None:
    with EventJournal(folder) as journal:
        state = State(skills=SKILLS)
        for line in model.journal:
            state, _ = step(state, decode_event(line))
            journal.append(decode_event(line), state)


def test_events_come_back_in_order(tmp_path: Path) -> None:
    model = mission()
    keep(tmp_path, model)
    with EventJournal(tmp_path) as journal:
        assert not journal.empty
        assert replay(journal.events()) == model.state


def test_a_new_journal_is_empty(tmp_path: Path) -> None:
    with EventJournal(tmp_path / "new") as journal:
        assert journal.empty
        assert journal.snapshot() == (0, State())


def test_a_snapshot_shortens_the_replay_and_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(event_journal, "SNAPSHOT_EVERY", 7)
    model = mission()
    keep(tmp_path, model)
    with EventJournal(tmp_path) as journal:
        number, state = journal.snapshot()
        rest = list(journal.events(number))
        assert number > 0
        assert len(rest) < 7
        assert replay(rest, state) == model.state


@pytest.mark.parametrize(
    "snapshot",
    [
        (HERE / "two-cups.snapshot-1.json").read_bytes(),
        msgspec.msgpack.encode({"format": 1, "state": {}}),
        msgspec.msgpack.encode({"format": SNAPSHOT_FORMAT, "state": {"plans": 7}}),
        b"rubbish",
    ],
    ids=["without-a-format", "older-format", "does-not-decode", "no-state"],
)
def test_a_snapshot_in_another_format_is_left_aside(tmp_path: Path, snapshot: bytes) -> None:
    journal = events_in("two-cups")
    with EventJournal(tmp_path) as kept:
        for event in journal:
            kept.append(event, State())
    with sqlite3.connect(tmp_path / "events.db") as db:
        db.execute("INSERT INTO snapshots VALUES (26, ?)", (snapshot,))
    with EventJournal(tmp_path) as kept:
        number, state = kept.snapshot()
        assert (number, state) == (0, State())
        assert replay(kept.events(number), state) == replay(journal)


@pytest.mark.parametrize(
    ("name", "taken_up", "open_now"),
    [("task-being-added", ["a task (navigate) is added"], 0), ("asked-twice", ["so"], 2)],
)
def test_a_snapshot_from_before_wishes_is_gone_on_from(
    tmp_path: Path, name: str, taken_up: list[str], open_now: int
) -> None:
    with EventJournal(tmp_path):
        pass
    with sqlite3.connect(tmp_path / "events.db") as db:
        kept = (HERE / f"{name}.snapshot-2.msgpack").read_bytes()
        db.execute("INSERT INTO snapshots VALUES (26, ?)", (kept,))
    with EventJournal(tmp_path) as journal:
        number, state = journal.snapshot()
    assert number == 26
    entry = state.plans["plan-1"]
    job = entry.job
    assert job is not None
    assert [r.sentence for r in entry.open_reasons if r.number in job.takes_up] == taken_up
    started = PlannerStarted(
        epoch=2, incarnation="x", skills=SKILLS, logic=LOGIC, time_s=50.0, wall_time_s=1e3
    )
    failed = PlanningFailed(job=job.job, reason="no way", time_s=50.0, wall_time_s=1e3)
    state = replay([started, failed], state)
    entry = state.plans["plan-1"]
    assert len(entry.open_reasons) == open_now
    if name == "task-being-added":
        assert entry.state is PlanState.RUNNING
        assert state.answers["c"].sentence == "the task was not added: no way"


def test_the_format_counts_up_when_a_field_of_the_state_gets_another_name() -> None:
    kinds = (State, PlanEntry, PlanningJob, PlanOutcome, ReplanReason, Policy)
    names = " ".join(name for kind in kinds for name in kind.__struct_encode_fields__)
    assert {SNAPSHOT_FORMAT: zlib.crc32(names.encode())} == {4: 3270002805}, (
        "count SNAPSHOT_FORMAT up"
    )


def test_two_planners_cannot_have_one_journal(tmp_path: Path) -> None:
    with EventJournal(tmp_path):
        with pytest.raises(JournalInUse, match="another planner works with"):
            EventJournal(tmp_path).__enter__()
