"""The planner's event journal: order, snapshots, one planner at a time."""

from __future__ import annotations

import sqlite3
import zlib
from contextlib import closing
from pathlib import Path

import msgspec
import pytest

from fleet.core.events import PlannerStarted, PlanningFailed, decode_event
from fleet.core.plan_entry import PlanEntry, PlanningJob, PlanOutcome
from fleet.core.replan_reasons import ReplanReason
from fleet.core.state import LOGIC, Policy, State
from fleet.core.step import replay, step
from fleet.service.event_journal import EventJournal, JournalInUse, JournalUnreadable
from fleet.service.recovery import recover
from fleet.service.snapshots import SNAPSHOT_FORMAT, Snapshot
from keyexpr_schema.payloads.history import RequestRecord
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.whole_files import beside_of
from tests.replay.journal_files import HERE, events_in
from tests.support.fleet_model import FleetModel
from tests.support.household import SKILLS, bring, carrier, manipulator
from tests.support.open_files import nothing_stays_open


def mission() -> FleetModel:
    model = FleetModel((manipulator(), carrier()), cups=2)
    model.plan(bring(1, "hallway"), bring(2, "living_room"))
    model.finish()
    return model


def keep(folder: Path, model: FleetModel, snapshot_at: tuple[int, ...] = ()) -> None:
    with EventJournal(folder) as journal:
        state = State(skills=SKILLS)
        for number, line in enumerate(model.journal, 1):
            state, _ = step(state, decode_event(line))
            journal.append(decode_event(line))
            if number in snapshot_at:
                journal.write_snapshot(Snapshot(state=state, number=number))
                journal.cut()


def numbers_in(folder: Path) -> list[int]:
    with EventJournal(folder) as journal:
        return [number for number, _ in journal.events()]


def test_events_come_back_in_order(tmp_path: Path) -> None:
    model = mission()
    keep(tmp_path, model)
    with EventJournal(tmp_path) as journal:
        assert not journal.empty
        assert [number for number, _ in journal.events()] == list(range(1, journal.last + 1))
        assert recover(journal, SKILLS).state == model.state


def test_a_new_journal_is_empty(tmp_path: Path) -> None:
    with EventJournal(tmp_path / "new") as journal:
        assert journal.empty
        assert journal.snapshot() == Snapshot(state=State())


def test_a_snapshot_shortens_the_replay_and_changes_nothing(tmp_path: Path) -> None:
    model = mission()
    keep(tmp_path, model, snapshot_at=(20,))
    with EventJournal(tmp_path) as journal:
        recovered = recover(journal, SKILLS)
        assert recovered.replayed == journal.last - 20
        assert recovered.state == model.state


def test_events_below_the_last_two_snapshots_are_gone_and_numbers_go_on(tmp_path: Path) -> None:
    model = mission()
    keep(tmp_path, model, snapshot_at=(10, 20, 30))
    assert numbers_in(tmp_path)[0] == 21
    last = len(model.journal)
    with EventJournal(tmp_path) as journal:
        for number in (last, last + 1, last + 2):
            journal.write_snapshot(Snapshot(state=model.state, number=number))
        journal.cut()
        assert not list(journal.events()), "all of them are below the snapshots"
    with EventJournal(tmp_path) as journal:
        assert journal.last == last + 2
        journal.append(decode_event(model.journal[-1]))
    assert numbers_in(tmp_path) == [last + 3]


def test_a_snapshot_that_cannot_be_read_is_fallen_back_from(tmp_path: Path) -> None:
    model = mission()
    keep(tmp_path, model, snapshot_at=(10, 20, 30))
    newest = max(tmp_path.glob("snapshot-*"))
    newest.write_bytes(newest.read_bytes()[:100])
    with EventJournal(tmp_path) as journal:
        assert journal.snapshot().number == 20
        assert recover(journal, SKILLS).state == model.state


def test_without_a_snapshot_that_can_be_read_a_cut_journal_is_refused(tmp_path: Path) -> None:
    keep(tmp_path, mission(), snapshot_at=(10, 20, 30))
    for path in tmp_path.glob("snapshot-*"):
        path.write_bytes(msgspec.msgpack.encode({"format": SNAPSHOT_FORMAT + 1, "state": {}}))
    with EventJournal(tmp_path) as journal:
        with pytest.raises(JournalUnreadable, match="start the version that wrote them"):
            journal.snapshot()


def test_a_snapshot_that_was_not_written_to_its_end_counts_for_nothing(tmp_path: Path) -> None:
    model = mission()
    keep(tmp_path, model, snapshot_at=(10,))
    for name in ("snapshot-20.new", beside_of(tmp_path / "snapshot-21.msgpack").name):
        (tmp_path / name).write_bytes(b"half of")
    with EventJournal(tmp_path) as journal:
        assert journal.snapshot().number == 10
    assert not list(tmp_path.glob("*.new"))


def test_the_file_does_not_grow_with_what_is_over(tmp_path: Path) -> None:
    line = decode_event(mission().journal[0])
    sizes = []
    with EventJournal(tmp_path) as journal:
        for _ in range(6):
            for _ in range(2000):
                journal.append(line)
            journal.write_snapshot(Snapshot(state=State(), number=journal.last))
            journal.cut()
            sizes.append(sum(path.stat().st_size for path in tmp_path.iterdir()))
    assert sizes[-1] <= sizes[2]


def test_a_large_journal_of_an_earlier_version_is_made_small(tmp_path: Path) -> None:
    line = decode_event(mission().journal[0])
    with EventJournal(tmp_path) as journal:
        for _ in range(40_000):
            journal.append(line)
        before = (tmp_path / "events.db").stat().st_size
        for number in (journal.last - 1, journal.last):
            journal.write_snapshot(Snapshot(state=State(), number=number))
        journal.cut()
    assert (tmp_path / "events.db").stat().st_size < before / 10


@pytest.mark.parametrize(
    "snapshot",
    [
        (HERE / "two-cups.snapshot-1.json").read_bytes(),
        msgspec.msgpack.encode({"format": SNAPSHOT_FORMAT - 2, "state": {}}),
        msgspec.msgpack.encode({"format": SNAPSHOT_FORMAT, "state": {"plans": 7}}),
        b"rubbish",
    ],
    ids=["without-a-format", "older-format", "does-not-decode", "no-state"],
)
def test_a_snapshot_of_an_earlier_version_is_left_aside(tmp_path: Path, snapshot: bytes) -> None:
    """It stood in a table, and all of its events are still there."""
    journal = events_in("two-cups")
    with EventJournal(tmp_path) as kept:
        for event in journal:
            kept.append(event)
    with closing(sqlite3.connect(tmp_path / "events.db")) as db, db:
        db.execute("CREATE TABLE snapshots (number INTEGER PRIMARY KEY, state BLOB NOT NULL)")
        db.execute("INSERT INTO snapshots VALUES (26, ?)", (snapshot,))
    with EventJournal(tmp_path) as kept:
        assert kept.snapshot() == Snapshot(state=State())
        assert recover(kept, SKILLS).state == replay(journal, State(skills=SKILLS))


@pytest.mark.parametrize(
    ("name", "taken_up", "open_now"),
    [("task-being-added", ["a task (navigate) is added"], 0), ("asked-twice", ["so"], 2)],
)
def test_a_snapshot_from_before_wishes_is_gone_on_from(
    tmp_path: Path, name: str, taken_up: list[str], open_now: int
) -> None:
    with closing(sqlite3.connect(tmp_path / "events.db")) as db, db:
        kept = (HERE / f"{name}.snapshot-2.msgpack").read_bytes()
        db.execute("CREATE TABLE snapshots (number INTEGER PRIMARY KEY, state BLOB NOT NULL)")
        db.execute("INSERT INTO snapshots VALUES (26, ?)", (kept,))
    with EventJournal(tmp_path) as journal:
        snapshot = journal.snapshot()
    assert snapshot.number == 26
    state = snapshot.state
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
        (answered,) = (r for r in state.over if isinstance(r, RequestRecord))
        assert answered.answer.request == "c"
        assert answered.answer.sentence == "the task was not added: no way"


def test_the_format_counts_up_when_a_field_of_the_state_gets_another_name() -> None:
    kinds = (State, PlanEntry, PlanningJob, PlanOutcome, ReplanReason, Policy)
    names = " ".join(name for kind in kinds for name in kind.__struct_encode_fields__)
    assert {SNAPSHOT_FORMAT: zlib.crc32(names.encode())} == {5: 4033452645}, (
        "count SNAPSHOT_FORMAT up"
    )


def test_two_planners_cannot_have_one_journal(tmp_path: Path) -> None:
    with EventJournal(tmp_path):
        with pytest.raises(JournalInUse, match="another planner works with"):
            EventJournal(tmp_path).__enter__()


def test_a_file_that_is_no_journal_is_one_sentence_and_left_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "events.db"
    file.write_text("shopping list")
    with nothing_stays_open():
        with pytest.raises(JournalUnreadable, match=r"not a database.*move it away") as refused:
            EventJournal(tmp_path).__enter__()
    assert refused
    assert file.read_text() == "shopping list"
    file.unlink()
    with EventJournal(tmp_path) as journal:  # nobody holds its lock
        assert journal.empty
