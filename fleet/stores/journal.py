"""The journal of a store: what changed when, by number, cut by count, by bytes and by age."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from fleet.stores.state_file import blob_of
from keyexpr_schema.transport.store.patterns import Patterns
from keyexpr_schema.transport.store.storage import AppliedWrite, JournalQuery, Write

_PRUNE_EVERY = 1000
"""Entries; bytes a sixteenth of what may be kept."""
_ROW_BYTES = 64
"""What an entry takes beside its key and its value, about."""
_SIZE = f"length(keyexpr) + length(data) + {_ROW_BYTES}"
_COLUMNS = "number, wall_time_s, keyexpr, deleted, stamp, data"


class _Extent(NamedTuple):
    """What there is: up to which number, and how many bytes."""

    last: int
    size: int


class StoreJournal:
    """The table `journal` of the database `db` in `path`: at most so many entries and so many
    bytes, none too old.

    Written through `db` in the transactions of the store; read through a connection of its own, so
    that a search holds no writer up. What is too much or too old goes when something is added, some
    at a time.
    """

    def __init__(
        self, db: sqlite3.Connection, path: Path, *, entries: int, size_bytes: float, age_s: float
    ) -> None:
        self._db, self._entries, self._size_bytes, self._age_s = db, entries, size_bytes, age_s
        self._reader = sqlite3.connect(path, check_same_thread=False, timeout=5.0)
        try:
            self._reader.execute("PRAGMA query_only = 1")
            last, size = db.execute(
                f"SELECT coalesce(max(number), 0), coalesce(sum({_SIZE}), 0) FROM journal"
            ).fetchone()
        except BaseException:
            self._reader.close()
            raise
        self._there = self._adding = _Extent(last, size)
        self._pruned = _Extent(-_PRUNE_EVERY, 0)

    @property
    def last(self) -> int:
        """The number of the newest entry."""
        return self._there.last

    def add(self, writes: Sequence[Write], wall_time_s: float) -> bool:
        """Add these, in the transaction that the caller has begun; see `added`.

        Whether it was looked for what is to leave.
        """
        self._db.executemany(
            "INSERT INTO journal (wall_time_s, keyexpr, deleted, stamp, data) "
            "VALUES (?, ?, ?, ?, ?)",
            [(wall_time_s, w.keyexpr, w.deleted, blob_of(w.stamp), w.data) for w in writes],
        )
        size = sum(len(w.keyexpr) + len(w.data) + _ROW_BYTES for w in writes)
        self._adding = _Extent(self._there.last + len(writes), self._there.size + size)
        entries_due = self._adding.last - self._pruned.last >= min(_PRUNE_EVERY, self._entries)
        bytes_due = self._adding.size - self._pruned.size >= self._size_bytes / 16
        if not entries_due and not bytes_due:
            return False
        self._pruned = self._adding = self._prune(self._adding, wall_time_s)
        return True

    def _prune(self, there: _Extent, wall_time_s: float) -> _Extent:
        """Looks at what goes and at one entry more; the newest stays."""
        size, gone = there.size, 0
        oldest_first = self._db.execute(
            f"SELECT number, wall_time_s, {_SIZE} FROM journal WHERE number < ? ORDER BY number",
            (there.last,),
        )
        for number, said_s, bytes_of in oldest_first:
            if (
                number > there.last - self._entries
                and size <= self._size_bytes
                and said_s >= wall_time_s - self._age_s
            ):
                break
            size, gone = size - bytes_of, number
        oldest_first.close()
        self._db.execute("DELETE FROM journal WHERE number <= ?", (gone,))
        return _Extent(there.last, size)

    def added(self) -> None:
        """What was added is on disk now."""
        self._there = self._adding

    def entries(self, realm: str, asked: JournalQuery) -> list[AppliedWrite]:
        """What is asked for of the keys of `realm`, oldest first."""
        pattern = f"{realm}/{asked.pattern}"
        matches = Patterns([pattern]).matches
        literal = pattern.partition("*")[0].rpartition("/")[0]
        after = asked.after
        if asked.since_s is not None:
            after = max(after, self._before(asked.since_s))
        rows = self._reader.execute(
            f"SELECT {_COLUMNS} FROM journal WHERE number > ? AND substr(keyexpr, 1, ?) = ? "
            f"ORDER BY number {'DESC' if asked.newest else ''}",
            (after, len(literal), literal),
        )
        found: list[AppliedWrite] = []
        for number, wall_s, keyexpr, deleted, stamp, data in rows:
            if len(found) >= asked.limit:
                break
            if matches(keyexpr):
                number_of = int.from_bytes(stamp, "big")
                found.append(AppliedWrite(number, wall_s, keyexpr, bool(deleted), number_of, data))
        rows.close()
        return found[::-1] if asked.newest else found

    def _before(self, since_s: float) -> int:
        """The number of the last entry applied before `since_s`, by bisection."""
        low, high = 0, self.last
        while low < high:
            middle = (low + high + 1) // 2
            row = self._reader.execute(
                "SELECT wall_time_s FROM journal WHERE number <= ? ORDER BY number DESC LIMIT 1",
                (middle,),
            ).fetchone()
            if row is None or row[0] < since_s:
                low = middle
            else:
                high = middle - 1
        return low

    def close(self) -> None:
        """Close the reader's connection; the writer's is the store's."""
        self._reader.close()
