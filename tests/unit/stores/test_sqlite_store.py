"""The store on disk: locks, damage, pruning, reopening."""

from __future__ import annotations

import sqlite3
import sys
from contextlib import closing
from pathlib import Path

import pytest

from fleet.errors import StoreError, StoreInUse
from fleet.stores.sqlite import SqliteStore, StoreMemory
from keyexpr_schema.transport.store.storage import JournalQuery, Write
from tests.support.child_process import blocking_child
from tests.support.open_files import nothing_stays_open
from tests.support.stored import as_written


def write(name: str, time: int, *, deleted: bool = False, data: bytes = b"1") -> Write:
    return Write(f"north/world/places/{name}", time << 128 | 7, deleted, "application/json", data)


def test_a_second_store_on_the_same_directory_is_refused_until_the_first_closes(tmp_path):
    said = f"another router uses the store in {tmp_path}: stop"
    with SqliteStore(tmp_path), pytest.raises(StoreInUse, match=said):
        SqliteStore(tmp_path)
    SqliteStore(tmp_path).close()


def test_a_directory_that_cannot_be_made_is_one_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot be used: Not a directory"):
        SqliteStore(tmp_path / "file" / "store")


def test_a_damaged_file_is_one_sentence_and_nothing_stays_open(tmp_path):
    (tmp_path / "state.sqlite").write_bytes(b"not a database, " * 100)
    for _ in range(2):
        with nothing_stays_open():
            with pytest.raises(StoreError, match=r"file is not a database.*move it away"):
                SqliteStore(tmp_path)


def test_a_store_whose_tables_are_others_is_one_sentence_and_nothing_stays_open(tmp_path):
    with closing(sqlite3.connect(tmp_path / "state.sqlite")) as db:
        db.execute("CREATE TABLE latest (something)")
    with nothing_stays_open():
        with pytest.raises(StoreError, match="no such column") as refused:
            SqliteStore(tmp_path)
    assert "move it away" in str(refused.value)


def test_a_store_of_a_later_format_is_left_alone(tmp_path):
    SqliteStore(tmp_path).close()
    db = sqlite3.connect(tmp_path / "state.sqlite")
    db.execute("PRAGMA user_version = 99")
    db.close()
    with pytest.raises(StoreError, match="has format 99, but this program knows formats up to 3"):
        SqliteStore(tmp_path)


def test_a_tombstone_holds_after_reopening(tmp_path):
    with SqliteStore(tmp_path) as store:
        assert store.apply([write("a", 1), write("b", 1)]) == 2
        assert store.apply([write("a", 3, deleted=True)]) == 1
    with SqliteStore(tmp_path) as store:
        assert store.apply([write("a", 2)]) == 0
        assert store.select("north/world/places/a") == []
        assert as_written(store.select("north/world/places/b")) == [write("b", 1)]
        assert store.apply([write("a", 4)]) == 1
        assert as_written(store.select("north/world/places/*")) == [write("a", 4), write("b", 1)]


def test_a_wildcard_write_concerns_older_values_that_exist_and_no_others(tmp_path):
    with SqliteStore(tmp_path) as store:
        store.apply([write("a", 1), write("b", 9), write("c", 2, deleted=True)])
        assert store.apply([write("*", 5, data=b"2")]) == 1
        assert as_written(store.select("**")) == [write("a", 5, data=b"2"), write("b", 9)]
        # In one batch, too, and in its order.
        assert store.apply([write("d", 10), write("**", 11, deleted=True), write("e", 12)]) == 5
        assert as_written(store.select("**")) == [write("e", 12)]


def test_the_journal_tells_realms_apart_pages_and_forgets(tmp_path):
    with SqliteStore(
        tmp_path, memory=StoreMemory(journal_entries=10), wall_time_s=lambda: 5.0
    ) as store:
        store.apply([write(f"p{number}", number) for number in range(1, 31)])
        entries, last = store.journal("north", JournalQuery(0, 1000))
        assert [entry.number for entry in entries] == list(range(21, 31))
        assert last == 30
        assert {entry.wall_time_s for entry in entries} == {5.0}
        assert [e.number for e in store.journal("north", JournalQuery(25, 2))[0]] == [26, 27]
        assert store.journal("north", JournalQuery(25, 0)) == ([], 30)
        assert store.journal("south", JournalQuery(0, 1000)) == ([], 30)
    with SqliteStore(tmp_path) as store:
        store.apply([write("q", 99)])
        assert store.journal("north", JournalQuery(30, 10))[0][0].number == 31


def test_a_write_without_a_timestamp_is_refused_and_nothing_of_its_batch_is_applied(tmp_path):
    with SqliteStore(tmp_path) as store:
        with pytest.raises(StoreError, match="carries no timestamp"):
            store.apply([write("a", 1), Write("north/world/places/b", 0, False, "", b"")])
        assert store.select("**") == []


def test_what_could_not_be_written_is_not_shown(tmp_path):
    with SqliteStore(tmp_path) as store:
        store.apply([write("a", 1)])
        other = sqlite3.connect(tmp_path / "state.sqlite")
        other.execute(
            "CREATE TRIGGER full BEFORE INSERT ON journal BEGIN "
            "SELECT RAISE(ABORT, 'disk is full'); END"
        )
        other.commit()
        with pytest.raises(StoreError, match="the store could not write: disk is full"):
            store.apply([write("a", 2), write("b", 2)])
        assert as_written(store.select("**")) == [write("a", 1)]
        other.execute("DROP TRIGGER full")
        other.commit()
        other.close()
        assert store.apply([write("a", 2), write("b", 2)]) == 2
    with SqliteStore(tmp_path) as store:
        assert [w.stamp >> 128 for w in store.select("**")] == [2, 2]


@pytest.mark.parametrize("round_number", range(3))
def test_every_applied_write_survives_kill_9(tmp_path, round_number):
    """The child prints a number only after `apply` returned; killed while it goes on."""
    program = f"""
from pathlib import Path
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.transport.store.storage import JournalQuery, Write
from tests.support.stored import as_written
with SqliteStore(Path({str(tmp_path)!r})) as store:
    for number in range(1, 10**9):
        key = f"north/world/places/p{{number % 50}}"
        store.apply([Write(key, number << 128 | 7, False, "", str(number).encode())])
        print(number, flush=True)
"""
    with blocking_child(sys.executable, "-c", program) as child:
        assert child.stdout is not None
        last = 0
        while last < 200 + 37 * round_number:
            last = int(child.stdout.readline())
        child.kill()
        rest = child.stdout.read().split("\n")
    last = max([last, *(int(line) for line in rest[:-1])])
    with SqliteStore(Path(tmp_path)) as store:
        assert max(int(w.data) for w in store.select("**")) in (last, last + 1)
        assert len(store.select("**")) == 50
