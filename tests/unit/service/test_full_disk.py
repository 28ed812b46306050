"""A planner whose disk is full waits, loses nothing, and goes on; what it cannot read it says."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from fleet.core import events
from fleet.service.event_journal import EventJournal, JournalUnreadable
from keyexpr_schema.full_disk import FullDisk, is_full
from keyexpr_schema.payloads.world import Place


async def test_what_cannot_be_written_for_want_of_room_is_written_when_there_is(
    tmp_path: Path,
) -> None:
    with closing(sqlite3.connect(tmp_path / "a.db", isolation_level=None)) as db:
        db.execute("CREATE TABLE kept (number INTEGER, data BLOB)")
        db.execute("PRAGMA max_page_count = 4")
        told: list[str | None] = []
        tries: list[int] = []

        def keep() -> int:
            tries.append(len(tries))
            if len(tries) == 3:  # somebody has made room
                db.execute("PRAGMA max_page_count = 1000")
            db.execute("INSERT INTO kept VALUES (1, ?)", (b"x" * 100_000,))
            return len(tries)

        disk = FullDisk(tmp_path, "the planner", "nothing is ordered", told.append, retry_s=0.0)
        assert await disk.written(keep) == 3
        assert db.execute("SELECT count(*) FROM kept").fetchone() == (1,)
        sentence, over = told
        assert over is None
        assert sentence is not None and sentence.startswith(
            f"the planner cannot write to {tmp_path} (database or disk is full): nothing is "
        )
        with pytest.raises(sqlite3.IntegrityError):  # what is no want of room is an error
            db.execute("CREATE UNIQUE INDEX one ON kept (number)")
            await disk.written(lambda: db.execute("INSERT INTO kept VALUES (1, NULL)"))
    assert not is_full(sqlite3.OperationalError("no such table"))


FULL = """
import resource, signal, sqlite3, sys
from pathlib import Path
from fleet.core import events
from fleet.history.archive import Archive
from fleet.service.event_journal import EventJournal
from keyexpr_schema.full_disk import is_full
from keyexpr_schema.payloads.history import RequestRecord
from keyexpr_schema.payloads.requests import Answer
from keyexpr_schema.payloads.world import Place

def put(n):
    place = Place(place=f"p{n}", label="x" * 2000)
    return events.PlacePut(place=place, time_s=0.0, wall_time_s=0.0)

def record(n):
    answer = Answer(request=f"r{n}", accepted=True, sentence="%032x" % (n * 7919 ** 9))
    return RequestRecord(answer=answer, ended_s=0.0, ended_wall_s=float(n))

folder = Path(sys.argv[1])
with EventJournal(folder) as journal, Archive(folder) as archive:
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, resource.RLIM_INFINITY))
    kept = []
    for write in (lambda n: journal.append(put(n)), lambda n: archive.add([record(n)])):
        n = 0
        while True:
            try:
                write(n)
            except sqlite3.Error as error:
                assert is_full(error), error
                kept.append(n)
                break
            n += 1
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    journal.append(put(kept[0]))
    archive.add([record(kept[1])])
    assert len(list(journal.events())) == kept[0] + 1 > 10
    assert all(archive.answered(f"r{n}") for n in range(kept[1] + 1)) and kept[1] > 1
print("went on")
"""


def test_journal_and_archive_lose_nothing_and_go_on(tmp_path: Path) -> None:
    """The system refuses to write: what was kept stays, and what comes next is kept."""
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == ("went on\n", "")


def place(name: str) -> events.PlacePut:
    return events.PlacePut(place=Place(place=name, label=name), time_s=0.0, wall_time_s=0.0)


@pytest.mark.parametrize("damage", [b'{"event":"FromTheFuture","time_s":1.0}', b"\xff\x00", b"{"])
def test_an_event_of_another_version_or_damaged_is_a_sentence(
    tmp_path: Path, damage: bytes
) -> None:
    with EventJournal(tmp_path) as journal:
        journal.append(place("kitchen"))
        journal.append_encoded(damage)
    with (
        EventJournal(tmp_path) as journal,
        pytest.raises(JournalUnreadable, match=r"event 2 in .* cannot be read by this version"),
    ):
        list(journal.events())


def test_folders_where_files_are_meant_are_told(tmp_path: Path) -> None:
    (tmp_path / "a" / "events.db").mkdir(parents=True)
    with (
        pytest.raises(JournalUnreadable, match=r"events.db cannot be used \(.* is a folder"),
        EventJournal(tmp_path / "a"),
    ):
        pass
    with EventJournal(tmp_path / "b") as journal:
        journal.append(place("kitchen"))
    (tmp_path / "b" / "snapshot-000000000001.msgpack").mkdir()
    with EventJournal(tmp_path / "b") as journal:
        assert journal.snapshot().number == 0  # the events are all there


def test_a_journal_of_a_newer_version_is_told(tmp_path: Path) -> None:
    with EventJournal(tmp_path) as journal:
        journal.append(place("kitchen"))
    with closing(sqlite3.connect(tmp_path / "events.db")) as db:
        db.execute("PRAGMA user_version = 7")
    with (
        pytest.raises(JournalUnreadable, match=r"has format 7, but this program knows formats up"),
        EventJournal(tmp_path),
    ):
        pass
