"""The order journal: what is on disk, who may open it, and what waits to be sent."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace

from keyexpr_schema.payloads.tasks import Order, Report, ReportState
from keyexpr_schema.payloads.world import Fact
from workers.errors import JournalBusy, JournalUnreadable
from workers.orders.fencing import Phase, attempt_name
from workers.orders.journal import Journal
from workers.orders.outbox import make_report


def order(task: str = "t1", attempt: int = 1) -> Order:
    return Order(
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
        assert words(journal) == [fact("kitchen"), end]


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
        phases = {name[1]: e.phase for name, e in journal.ledger.attempts.items()}
        assert phases == {"t1": Phase.ENDED, "t2": Phase.STARTED}
        first = journal.unsent()
        assert first is not None and first.payload == fact("hallway") and first.earlier_run
        journal.send(fact("kitchen"))
        said = words(journal)
        assert [type(word) for word in said] == [Fact, Report, Report, Fact]


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
    with sqlite3.connect(path) as db:
        db.execute("PRAGMA user_version=99")
    db.close()
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
        assert journal.ledger.attempts[attempt_name(order())].order.skill == "navigate"
    with Journal(path) as journal:
        assert (journal.ledger.epoch, journal.ledger.revisions) == (7, {"p": 3})
