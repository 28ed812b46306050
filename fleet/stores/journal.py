"""The journal of a store: what changed when, by number, cut by count and by age."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from pathlib import Path

from fleet.stores.index import matcher
from fleet.stores.state_file import blob_of
from keyexpr_schema.transport.store.storage import AppliedWrite, JournalQuery, Write

_PRUNE_EVERY = 1000
_COLUMNS = "number, wall_time_s, keyexpr, deleted, stamp, data"


class StoreJournal:
    """The table `journal` of the database `db` in `path`: at most `limit` entries, none too old.

    Written through `db` in the transactions of the store; read through a connection of its own, so
    that a search holds no writer up. What is too old goes when something is added.
    """

    def __init__(self, db: sqlite3.Connection, path: Path, limit: int, age_s: float) -> None:
        self._db, self._limit, self._age_s = db, limit, age_s
        self._reader = sqlite3.connect(path, check_same_thread=False, timeout=5.0)
        self._reader.execute("PRAGMA query_only = 1")
        self.last: int = db.execute("SELECT coalesce(max(number), 0) FROM journal").fetchone()[0]
        self._pruned_at = -_PRUNE_EVERY

    def add(self, writes: Sequence[Write], wall_time_s: float) -> None:
        """Add these, in the transaction that the caller has begun; see `added`."""
        self._db.executemany(
            "INSERT INTO journal (wall_time_s, keyexpr, deleted, stamp, data) "
            "VALUES (?, ?, ?, ?, ?)",
            [(wall_time_s, w.keyexpr, w.deleted, blob_of(w.stamp), w.data) for w in writes],
        )
        last = self.last + len(writes)
        if last - self._pruned_at >= min(_PRUNE_EVERY, self._limit):
            self._prune(last, wall_time_s)

    def added(self, count: int) -> None:
        """So many were added, and are on disk now."""
        self.last += count
        if self.last - self._pruned_at >= min(_PRUNE_EVERY, self._limit):
            self._pruned_at = self.last

    def _prune(self, last: int, wall_time_s: float) -> None:
        """Looks at what goes and at one entry more."""
        self._db.execute("DELETE FROM journal WHERE number <= ?", (last - self._limit,))
        self._db.execute(
            "DELETE FROM journal WHERE number < coalesce((SELECT number FROM journal "
            "WHERE wall_time_s >= ? ORDER BY number LIMIT 1), ?)",
            (wall_time_s - self._age_s, last + 1),
        )

    def entries(self, realm: str, asked: JournalQuery) -> list[AppliedWrite]:
        """What is asked for of the keys of `realm`, oldest first."""
        pattern = f"{realm}/{asked.pattern}"
        fits = matcher(pattern).fullmatch
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
            if fits("/" + keyexpr):
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
