"""`SqliteStore`: one SQLite file, write-ahead logged, one transaction a batch."""

from __future__ import annotations

import os
import sqlite3
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from sys import intern
from typing import Literal, Self

from fleet.errors import StoreError
from fleet.stores.index import Index
from fleet.stores.state_file import STAMP_BYTES, identity_of, open_file, take_lock
from keyexpr_schema.transport.store.storage import AppliedWrite, Changes, Write, is_journaled

_PRUNE_EVERY = 1000


class SqliteStore:
    """The `Store` of a router in the directory `data_dir`, which one process uses at a time.

    `synchronous`: `NORMAL` outlives the end of the process at any moment; `FULL` also a power cut,
    at about half the speed. `journal_limit`: how many changes the journal remembers.

    Raises:
        StoreInUse: another process has it open.
        StoreError: the directory or the file cannot be used; from `apply`, that nothing of the
            batch was applied.
    """

    def __init__(
        self,
        data_dir: Path,
        *,
        synchronous: Literal["NORMAL", "FULL"] = "NORMAL",
        journal_limit: int = 100_000,
        wall_time_s: Callable[[], float] = time.time,
    ) -> None:
        self._wall_time_s = wall_time_s
        self._journal_limit = journal_limit
        self._lock = threading.Lock()
        self._since_prune = 0
        self._forgotten = 0
        self._guard = take_lock(data_dir)
        path = data_dir / "state.sqlite"
        try:
            self._db = open_file(path, synchronous)
            self._identity = identity_of(self._db, path)
            self._index = self._load()
            self._last = self._db.execute(
                "SELECT coalesce(max(number), 0) FROM journal"
            ).fetchone()[0]
        except sqlite3.Error as error:
            os.close(self._guard)
            raise StoreError(
                f"the store {path} cannot be used ({error}): move it away to begin with an "
                "empty one"
            ) from None
        except StoreError:
            os.close(self._guard)
            raise

    def _load(self) -> Index:
        rows = self._db.execute(
            "SELECT number, keyexpr, stamp, deleted, encoding, data FROM latest"
        ).fetchall()
        rows.sort()
        index = Index()
        for number, keyexpr, stamp, deleted, encoding, data in rows:
            write = Write(
                keyexpr, int.from_bytes(stamp, "big"), bool(deleted), intern(encoding), data
            )
            index.set(number, write)
        return index

    def apply(self, batch: Sequence[Write]) -> int:
        for write in batch:
            if write.stamp <= 0:
                raise StoreError(f"a write to {write.keyexpr!r} carries no timestamp")
        now_s = self._wall_time_s()
        with self._lock:
            changes = self._decide(batch)
            if not changes:
                return 0
            newest = {w.keyexpr: number for number, w in enumerate(changes, self._index.last + 1)}
            fresh = [
                (number, write)
                for number, write in enumerate(changes, self._index.last + 1)
                if newest[write.keyexpr] == number
            ]
            journaled = [write for write in changes if is_journaled(write.keyexpr)]
            try:
                with self._db:
                    self._db.executemany(
                        "INSERT OR REPLACE INTO latest VALUES (?, ?, ?, ?, ?, ?, ?)",
                        [
                            (w.keyexpr, _blob(w.stamp), w.deleted, w.encoding, w.data, n, now_s)
                            for n, w in fresh
                        ],
                    )
                    self._db.executemany(
                        "INSERT INTO journal (wall_time_s, keyexpr, deleted, stamp, data) "
                        "VALUES (?, ?, ?, ?, ?)",
                        [(now_s, w.keyexpr, w.deleted, _blob(w.stamp), w.data) for w in journaled],
                    )
                    self._prune(len(journaled))
            except sqlite3.Error as error:
                raise StoreError(f"the store could not write: {error}") from error
            # Only now: what a reader sees must be durable.
            self._last += len(journaled)
            for number, write in fresh:
                self._index.set(number, write)
            return len(changes)

    def _decide(self, batch: Sequence[Write]) -> list[Write]:
        """The writes of `batch` that win, in their order."""
        fresh: dict[str, Write] = {}
        changes: list[Write] = []
        for write in batch:
            for one in (write,) if "*" not in write.keyexpr else self._concrete(write, fresh):
                known = fresh.get(one.keyexpr) or self._index.get(one.keyexpr)
                if known is None or one.stamp > known.stamp:
                    fresh[one.keyexpr] = one
                    changes.append(one)
        return changes

    def _concrete(self, write: Write, fresh: dict[str, Write]) -> list[Write]:
        keys = {found.keyexpr for found in self._index.matching(write.keyexpr)}
        pending = Index()
        for one in fresh.values():
            if one.deleted:
                keys.discard(one.keyexpr)
            else:
                pending.set(1, one)
        keys.update(found.keyexpr for found in pending.matching(write.keyexpr))
        return [
            Write(key, write.stamp, write.deleted, write.encoding, write.data)
            for key in sorted(keys)
        ]

    def _prune(self, added: int) -> None:
        self._since_prune += added
        if self._since_prune >= min(_PRUNE_EVERY, self._journal_limit):
            self._since_prune = 0
            self._db.execute(
                "DELETE FROM journal WHERE number <= (SELECT max(number) FROM journal) - ?",
                (self._journal_limit,),
            )

    def select(self, pattern: str) -> list[Write]:
        with self._lock:
            return self._index.matching(pattern)

    def newest(self, keyexprs: Sequence[str]) -> list[Write | None]:
        with self._lock:
            return [self._index.get(keyexpr) for keyexpr in keyexprs]

    def changes(self, patterns: Sequence[str], position: str, limit: int) -> Changes:
        with self._lock:
            last = self._index.last
            began, after = self._place(position)
            # Deletions up to `began` are none for who began then with nothing; of those after it
            # none may be forgotten.
            whole = not 0 <= after <= last or max(began, after) < self._forgotten
            if whole:
                began, after = last, 0
            found, more = self._index.since(patterns, after, max(1, limit), began)
            reached = found[-1][0] if more else last
        writes = [write for _, write in found]
        return Changes(writes, f"{self._identity}/{began}/{reached}", whole, more)

    def _place(self, position: str) -> tuple[int, int]:
        """When the asker began to list, and up to which change it knows all; -1 if of no use."""
        identity, _, numbers = position.partition("/")
        began, _, after = numbers.partition("/")
        if identity == self._identity and began.isdecimal() and after.isdecimal():
            return int(began), int(after)
        return -1, -1

    def journal(self, prefix: str, after: int, limit: int) -> tuple[list[AppliedWrite], int]:
        with self._lock:
            rows = self._db.execute(
                "SELECT number, wall_time_s, keyexpr, deleted, stamp, data FROM journal "
                "WHERE number > ? AND substr(keyexpr, 1, ?) = ? ORDER BY number LIMIT ?",
                (after, len(prefix) + 1, prefix + "/", max(0, limit)),
            ).fetchall()
            last = self._last
        entries = [
            AppliedWrite(number, wall_s, keyexpr, bool(deleted), int.from_bytes(stamp, "big"), data)
            for number, wall_s, keyexpr, deleted, stamp, data in rows
        ]
        return entries, last

    def close(self) -> None:
        """Release everything; what was applied stays."""
        with self._lock:
            self._db.close()
            if self._guard >= 0:
                os.close(self._guard)
                self._guard = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _blob(stamp: int) -> bytes:
    return stamp.to_bytes(STAMP_BYTES, "big")
