"""What changed since a position: pages, deletions, and when everything must be listed again."""

from __future__ import annotations

import shutil
import sqlite3
from pathlib import Path

from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.transport.store.storage import Changes, JournalQuery, Write
from tests.support.stored import as_written

PLACES = ["north/world/places/*"]


def write(name: str, time: int, *, deleted: bool = False) -> Write:
    data = b"" if deleted else str(time).encode()
    return Write(f"north/world/places/{name}", time << 128 | 7, deleted, "", data)


def names(changes: Changes) -> list[str]:
    return [("-" if w.deleted else "") + w.keyexpr.rpartition("/")[2] for w in changes.writes]


def test_changes_since_a_position_are_those_and_no_others(tmp_path):
    with SqliteStore(tmp_path) as store:
        store.apply([write("a", 1), write("b", 2), write("c", 3), write("c", 4, deleted=True)])
        listed = store.changes(PLACES, "", 100)
        assert (names(listed), listed.whole, listed.more) == (["a", "b"], True, False)
        again = store.changes(PLACES, listed.position, 100)
        assert (names(again), again.whole, again.more) == ([], False, False)
        store.apply([write("b", 5), write("d", 6), write("a", 7, deleted=True), write("d", 8)])
        since = store.changes(PLACES, again.position, 100)
        assert (names(since), since.whole) == (["b", "-a", "d"], False)
        # Reopened: the numbers go on where they were.
        position = since.position
    with SqliteStore(tmp_path) as store:
        store.apply([write("e", 9)])
        since = store.changes(PLACES, position, 100)
        assert (names(since), since.whole) == (["e"], False)


def test_pages_are_bounded_and_what_changes_between_two_of_them_is_not_missed(tmp_path):
    with SqliteStore(tmp_path) as store:
        store.apply([write(f"p{number}", number) for number in range(1, 26)])
        first = store.changes(PLACES, "", 10)
        assert (len(first.writes), first.more, first.whole) == (10, True, True)
        store.apply([write("p1", 99, deleted=True), write("p20", 100), write("new", 101)])
        second = store.changes(PLACES, first.position, 10)
        third = store.changes(PLACES, second.position, 10)
        assert (second.more, third.more) == (True, False)
        assert not second.whole
        assert names(second) + names(third) == [
            *(f"p{n}" for n in range(11, 26) if n != 20),
            *("-p1", "p20", "new"),
        ]


def test_large_values_make_short_pages(tmp_path):
    with SqliteStore(tmp_path) as store:
        large = b"x" * 600_000
        store.apply(
            [Write(f"north/world/places/{n}", n << 128 | 7, False, "", large) for n in range(1, 6)]
        )
        page, seen = store.changes(PLACES, "", 1000), 0
        while page.more:
            assert len(page.writes) <= 2
            seen += len(page.writes)
            page = store.changes(PLACES, page.position, 1000)
        assert seen + len(page.writes) == 5


def test_a_position_of_another_store_is_of_no_use(tmp_path):
    with SqliteStore(tmp_path / "a") as store:
        store.apply([write("a", 1), write("b", 2)])
        position = store.changes(PLACES, "", 100).position
    shutil.copytree(tmp_path / "a", tmp_path / "copy")
    for folder in ("copy", "new"):
        with SqliteStore(tmp_path / folder) as store:
            store.apply([write("c", 3), write("d", 4), write("e", 5)])
            since = store.changes(PLACES, position, 100)
            assert since.whole
            assert names(since)[-3:] == ["c", "d", "e"]
    for nonsense in ("x", "///", "a/b/c", position + "0000"):
        with SqliteStore(tmp_path / "a") as store:
            assert store.changes(PLACES, nonsense, 100).whole


def test_a_store_of_the_first_format_is_taken_over(tmp_path):
    tmp_path.mkdir(exist_ok=True)
    old = sqlite3.connect(tmp_path / "state.sqlite")
    old.executescript(
        """
        CREATE TABLE latest (keyexpr TEXT PRIMARY KEY, stamp BLOB NOT NULL,
            deleted INTEGER NOT NULL, encoding TEXT NOT NULL, data BLOB NOT NULL) WITHOUT ROWID;
        CREATE TABLE journal (number INTEGER PRIMARY KEY AUTOINCREMENT, wall_time_s REAL NOT NULL,
            keyexpr TEXT NOT NULL, deleted INTEGER NOT NULL, stamp BLOB NOT NULL,
            data BLOB NOT NULL);
        PRAGMA user_version = 1;
        """
    )
    writes = [write("z", 1), write("a", 2), write("gone", 3, deleted=True)]
    for number, one in enumerate(writes, 1):
        stamp = one.stamp.to_bytes(24, "big")
        row = (one.keyexpr, stamp, one.deleted, "", one.data)
        old.execute("INSERT INTO latest VALUES (?, ?, ?, ?, ?)", row)
        row = (number, 5.0, one.keyexpr, one.deleted, stamp, one.data)
        old.execute("INSERT INTO journal VALUES (?, ?, ?, ?, ?, ?)", row)
    old.commit()
    old.close()
    for _ in range(2):
        with SqliteStore(Path(tmp_path)) as store:
            assert as_written(store.select("**")) == [writes[1], writes[0]]
            assert names(store.changes(PLACES, "", 100)) == ["z", "a"]
            assert store.apply([write("gone", 2)]) == 0  # the tombstone holds
            assert [e.number for e in store.journal("north", JournalQuery(0, 100))[0]] == [1, 2, 3]
    with SqliteStore(Path(tmp_path)) as store:
        position = store.changes(PLACES, "", 100).position
        store.apply([write("n", 9)])
        assert names(store.changes(PLACES, position, 100)) == ["n"]
        assert store.journal("north", JournalQuery(3, 100))[0][0].number == 4
