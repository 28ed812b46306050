"""The order journal: what is on disk, who may open it, and what waits to be sent."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from keyexpr_schema.full_disk import is_full
from keyexpr_schema.payloads.tasks import Order, Report, ReportState
from keyexpr_schema.payloads.world import Fact
from tests.support.full_disk import no_room
from workers.errors import JournalBusy, JournalFull, JournalUnreadable
from workers.host_clock import running_s
from workers.orders.fencing import AttemptName, Phase, PlanName
from workers.orders.journal import Journal, Retention
from workers.orders.outbox import make_report


def order(task: str = "t1", attempt: int = 1, **more: Any) -> Order:
    return Order(
        **more,
        robot="hsr",
        plan="p",
        revision=1,
        task=task,
        attempt=attempt,
        epoch=1,
        skill="navigate",
        args={"robot": "hsr", "to": "kitchen"},
        deadline_s=60.0,
    )


def fact(value: str, time_s: float = 1.0) -> Fact:
    return Fact(subject="hsr", relation="at", value=value, source="hsr", time_s=time_s)


def words(journal: Journal) -> list[Fact | Report]:
    said = []
    while (word := journal.unsent()) is not None:
        said.append(word.payload)
        journal.sent(word.number)
    return said


def test_facts_go_out_before_the_report_and_a_start_is_overtaken_by_its_end(tmp_path: Path) -> None:
    with Journal(tmp_path / "hsr.journal") as journal:
        journal.queued(order())
        journal.started(order(), make_report(order(), "r1", ReportState.STARTED))
        end = replace(make_report(order(), "r1", ReportState.SUCCEEDED), facts=(fact("kitchen"),))
        journal.ended(order(), end)
        assert words(journal) == [fact("kitchen"), replace(end, told=True)]


def test_what_there_is_no_room_for_is_as_if_it_had_not_been_asked_for(tmp_path: Path) -> None:
    start = make_report(order(), "r1", ReportState.STARTED)
    end = make_report(order(), "r1", ReportState.SUCCEEDED)
    with Journal(tmp_path / "hsr.journal") as journal:
        with no_room(), pytest.raises(sqlite3.Error) as refused:
            journal.queued(order())
        assert is_full(refused.value)
        assert not journal.ledger.attempts
        journal.queued(order())
        journal.started(order(), start)
        with no_room():
            with pytest.raises(sqlite3.Error):
                journal.ended(order(), end)
            assert words(journal) == [start], "it is overtaken by nothing that is on disk"
            journal.dropped(AttemptName.of(order("t2")))
        (known,) = journal.ledger.attempts.values()
        assert known.phase is Phase.STARTED
        journal.ended(order(), end)
        assert words(journal) == [replace(end, told=True)]
    with Journal(tmp_path / "hsr.journal") as journal:
        assert [one.report for one in journal.ledger.attempts.values()] == [replace(end, told=True)]
        assert journal.unsent() is None


@pytest.mark.parametrize("damage", ["head", "middle", "tail", "folder", "phase"])
def test_a_damaged_journal_is_one_sentence(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "hsr.journal"
    with Journal(path) as journal:
        for number in range(20):
            journal.ended(order(f"t{number}"), make_report(order(), "r1", ReportState.FAILED))
    data = path.read_bytes()
    if damage == "folder":
        path.unlink()
        path.mkdir()
    elif damage == "phase":
        with closing(sqlite3.connect(path)) as db, db:
            db.execute("UPDATE attempt SET phase = 'dreamt' WHERE number = 3")
    else:
        cut = {"head": 0, "middle": 4096, "tail": len(data) // 2 + 17}[damage]
        path.write_bytes(data[:cut] + (b"" if damage == "tail" else b"\xa5" * (len(data) - cut)))
    expected = "it is a folder" if damage == "folder" else "damaged one .*: move it away to begin"
    with pytest.raises(JournalUnreadable, match=expected), Journal(path):
        pass


def test_a_journal_that_there_is_no_room_for_is_one_sentence(tmp_path: Path) -> None:
    with (
        no_room(),
        pytest.raises(JournalFull, match=r"hsr\.journal cannot be written: .*; free some room"),
        Journal(tmp_path / "hsr.journal"),
    ):
        pass


def test_a_killed_process_leaves_started_attempts_and_unsent_words(tmp_path: Path) -> None:
    path = tmp_path / "hsr.journal"
    program = f"""
import os, signal, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from pathlib import Path
from msgspec.structs import replace
from test_order_journal import fact, order
from keyexpr_schema.payloads.tasks import ReportState
from workers.orders.journal import Journal
from workers.orders.outbox import make_report
journal = Journal(Path({str(path)!r})).__enter__()
journal.queued(order("t1")); journal.queued(order("t2")); journal.queued(order("t3"))
end = make_report(order("t1"), "r1", ReportState.SUCCEEDED)
journal.ended(order("t1"), replace(end, facts=(fact("hallway"),)))
journal.started(order("t2"), make_report(order("t2"), "r1", ReportState.STARTED))
os.kill(os.getpid(), signal.SIGKILL)
"""
    killed = subprocess.run([sys.executable, "-c", program], check=False, capture_output=True)
    assert killed.returncode == -9, killed.stderr
    with Journal(path) as journal:
        phases = {name.task: e.phase for name, e in journal.ledger.attempts.items()}
        assert phases == {"t1": Phase.ENDED, "t2": Phase.STARTED}
        first = journal.unsent()
        assert first is not None and first.payload == fact("hallway")
        at, seen = fact("hallway").key, journal.seen
        assert seen.last(at) == fact("hallway"), "what was said before is known"
        assert seen.waits(at)
        seen_s = seen.seen_s(fact("hallway"))
        assert seen_s is not None and seen_s <= running_s() - first.age_s
        journal.send(fact("kitchen"))
        said = words(journal)
        assert [type(word) for word in said] == [Fact, Report, Report, Fact]
        assert not seen.waits(at)


def test_a_second_worker_is_told_that_the_journal_is_in_use(tmp_path: Path) -> None:
    path = tmp_path / "hsr.journal"
    with (
        Journal(path),
        pytest.raises(JournalBusy, match=r"another worker runs for this robot"),
        Journal(path),
    ):
        pass
    with Journal(path):
        pass  # free again


def test_a_file_that_is_no_journal_is_named(tmp_path: Path) -> None:
    path = tmp_path / "hsr.journal"
    path.write_bytes(b"not a database at all, but long enough to be looked at" * 40)
    with (
        pytest.raises(JournalUnreadable, match=r"hsr\.journal is not an order journal"),
        Journal(path),
    ):
        pass


def test_a_journal_of_another_version_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "hsr.journal"
    with closing(sqlite3.connect(path)) as db, db:
        db.execute("PRAGMA user_version=99")
    with pytest.raises(JournalUnreadable, match=r"version 99"), Journal(path):
        pass


def test_a_renewed_order_moves_the_fence_but_not_what_runs(tmp_path: Path) -> None:
    path = tmp_path / "hsr.journal"
    newer = Order(
        robot="hsr",
        plan="p",
        revision=3,
        task="t1",
        attempt=1,
        epoch=7,
        skill="search",
        args={},
        deadline_s=1.0,
    )
    with Journal(path) as journal:
        journal.queued(order())
        journal.started(order(), make_report(order(), "r1", ReportState.STARTED))
        journal.renewed(newer)
        assert journal.ledger.attempts[AttemptName.of(order())].order.skill == "navigate"
    with Journal(path) as journal:
        assert (journal.ledger.epoch, journal.ledger.revisions) == (7, {PlanName(None, "p"): 3})


VERSION_1 = """
CREATE TABLE fence (name TEXT PRIMARY KEY, highest INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE attempt (
    number INTEGER PRIMARY KEY,
    plan TEXT NOT NULL, task TEXT NOT NULL, attempt INTEGER NOT NULL,
    phase TEXT NOT NULL, "order" BLOB NOT NULL, report BLOB,
    UNIQUE (plan, task, attempt)
);
CREATE TABLE outbox (
    number INTEGER PRIMARY KEY AUTOINCREMENT, kind TEXT NOT NULL, payload BLOB NOT NULL
);
INSERT INTO fence VALUES ('', 4), ('p', 2);
PRAGMA user_version=1;
"""


def test_a_journal_of_the_version_before_is_read_and_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "hsr.journal"
    end = make_report(order("t1"), "r1", ReportState.SUCCEEDED)
    with closing(sqlite3.connect(path)) as db, db:
        db.executescript(VERSION_1)
        rows = (("t1", "ended", end), ("t2", "started", None))
        for task, phase, report in rows:
            db.execute(
                'INSERT INTO attempt (plan, task, attempt, phase, "order", report) '
                "VALUES ('p', ?, 1, ?, ?, ?)",
                (task, phase, encoded(order(task)), report and encoded(report)),
            )
        db.execute("INSERT INTO outbox (kind, payload) VALUES ('report', ?)", (encoded(end),))
    for _ in range(2):
        with Journal(path) as journal:
            ledger = journal.ledger
            assert (ledger.epoch, ledger.revisions) == (4, {PlanName(None, "p"): 2})
            assert {n.task: a.phase for n, a in ledger.attempts.items()} == {
                "t1": Phase.ENDED,
                "t2": Phase.STARTED,
            }
            unsent = journal.unsent()
            assert unsent is not None and unsent.payload == end


def encoded(payload: Order | Report) -> bytes:
    return msgspec.json.encode(payload)


def live(journal: Journal, count: int, first: int = 1) -> None:
    """Take on, carry out and report so many orders, each of which is gone then."""
    for serial in range(first, first + count):
        one = order(f"t{serial}", planner="lineage", serial=serial)
        journal.queued(one)
        journal.started(one, make_report(one, "r1", ReportState.STARTED))
        journal.ended(one, make_report(one, "r1", ReportState.SUCCEEDED))
        words(journal)
        journal.forget(lambda name: False)


def rows(path: Path) -> int:
    with closing(sqlite3.connect(path)) as db, db:
        tables = ("attempt", "fence", "outbox")
        counts = [db.execute(f"SELECT count(*) FROM {t}").fetchone()[0] for t in tables]
    return sum(counts)


def test_a_journal_holds_no_more_after_hundreds_of_orders_than_after_some(tmp_path: Path) -> None:
    path = tmp_path / "hsr.journal"
    sizes = []
    for opened in range(4):
        with Journal(path, Retention(count=20)) as journal:
            assert len(journal.ledger.attempts) <= 20
            live(journal, 60, first=1 + 60 * opened)
        sizes.append((rows(path), path.stat().st_size))
    assert len(set(sizes[1:])) == 1, sizes  # the first time, pages are still half empty


def test_what_is_over_is_forgotten_after_its_time_and_what_is_not_is_kept(tmp_path: Path) -> None:
    wall_s = 0.0
    keep = Retention(count=100, age_s=10.0)
    with Journal(tmp_path / "hsr.journal", keep, lambda: wall_s) as journal:
        live(journal, 3)
        standing, unreported = order("stands"), order("unreported")
        for one in (standing, unreported):
            journal.queued(one)
        journal.ended(standing, make_report(standing, "r1", ReportState.SUCCEEDED))
        words(journal)
        journal.ended(unreported, make_report(unreported, "r1", ReportState.SUCCEEDED))
        wall_s = 11.0
        journal.queued(order("waits"))
        journal.forget(lambda name: name.task == "stands")
        assert {n.task for n in journal.ledger.attempts} == {"stands", "unreported", "waits"}
