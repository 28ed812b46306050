"""`SqliteStore`: one SQLite file, write-ahead logged, one transaction a batch."""

from __future__ import annotations

import fcntl
import os
import sqlite3
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal, Self

from fleet.errors import StoreError, StoreInUse
from fleet.stores.index import Index
from keyexpr_schema.transport.storage import AppliedWrite, Write

FORMAT = 1
_STAMP_BYTES = 24
_PRUNE_EVERY = 1000
_TABLES = f"""
CREATE TABLE IF NOT EXISTS latest (
    keyexpr TEXT PRIMARY KEY,
    stamp BLOB NOT NULL,
    deleted INTEGER NOT NULL,
    encoding TEXT NOT NULL,
    data BLOB NOT NULL
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS journal (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    wall_time_s REAL NOT NULL,
    keyexpr TEXT NOT NULL,
    deleted INTEGER NOT NULL,
    stamp BLOB NOT NULL,
    data BLOB NOT NULL
);
PRAGMA user_version = {FORMAT};
"""


class SqliteStore:
    """A `transport.storage.Store` in the directory `data_dir`, which one process uses at a time.

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
        self._index = Index()
        self._stamps: dict[str, int] = {}
        self._since_prune = 0
        self._guard = _take_lock(data_dir)
        path = data_dir / "state.sqlite"
        try:
            self._db = _open(path, synchronous)
            self._load()
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

    def _load(self) -> None:
        rows = self._db.execute("SELECT keyexpr, stamp, deleted, encoding, data FROM latest")
        for keyexpr, stamp, deleted, encoding, data in rows:
            number = int.from_bytes(stamp, "big")
            self._stamps[keyexpr] = number
            if not deleted:
                self._index.set(Write(keyexpr, number, False, encoding, data))

    def apply(self, batch: Sequence[Write]) -> int:
        for write in batch:
            if write.stamp <= 0:
                raise StoreError(f"a write to {write.keyexpr!r} carries no timestamp")
        wall_time_s = self._wall_time_s()
        with self._lock:
            fresh, changes = self._decide(batch)
            if not changes:
                return 0
            try:
                with self._db:
                    self._db.executemany(
                        "INSERT OR REPLACE INTO latest VALUES (?, ?, ?, ?, ?)",
                        [
                            (w.keyexpr, _blob(w.stamp), w.deleted, w.encoding, w.data)
                            for w in fresh.values()
                        ],
                    )
                    self._db.executemany(
                        "INSERT INTO journal (wall_time_s, keyexpr, deleted, stamp, data) "
                        "VALUES (?, ?, ?, ?, ?)",
                        [
                            (wall_time_s, w.keyexpr, w.deleted, _blob(w.stamp), w.data)
                            for w in changes
                        ],
                    )
                    self._prune(len(changes))
            except sqlite3.Error as error:
                raise StoreError(f"the store could not write: {error}") from error
            # Only now: what a reader sees must be durable.
            self._last += len(changes)
            for write in fresh.values():
                self._stamps[write.keyexpr] = write.stamp
                if write.deleted:
                    self._index.remove(write.keyexpr)
                else:
                    self._index.set(write)
            return len(changes)

    def _decide(self, batch: Sequence[Write]) -> tuple[dict[str, Write], list[Write]]:
        """The writes of `batch` that win: the last of each key, and all in their order."""
        fresh: dict[str, Write] = {}
        changes: list[Write] = []
        for write in batch:
            for one in self._concrete(write, fresh):
                known = fresh.get(one.keyexpr)
                stamp = known.stamp if known is not None else self._stamps.get(one.keyexpr, 0)
                if one.stamp > stamp:
                    fresh[one.keyexpr] = one
                    changes.append(one)
        return fresh, changes

    def _concrete(self, write: Write, fresh: dict[str, Write]) -> list[Write]:
        if "*" not in write.keyexpr:
            return [write]
        keys = {found.keyexpr for found in self._index.matching(write.keyexpr)}
        pending = Index()
        for one in fresh.values():
            if one.deleted:
                keys.discard(one.keyexpr)
            else:
                pending.set(one)
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
    return stamp.to_bytes(_STAMP_BYTES, "big")


def _take_lock(data_dir: Path) -> int:
    try:
        data_dir.mkdir(parents=True, exist_ok=True)
        guard = os.open(data_dir / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise StoreError(
            f"the store directory {data_dir} cannot be used: {error.strerror}"
        ) from None
    try:
        # The kernel drops the lock with the process, however it ends.
        fcntl.flock(guard, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(guard)
        raise StoreInUse(
            f"another router uses the store in {data_dir}: stop it, or give this one another "
            "directory with --data"
        ) from None
    return guard


def _open(path: Path, synchronous: str) -> sqlite3.Connection:
    db = sqlite3.connect(path, check_same_thread=False, timeout=5.0)
    try:
        version = db.execute("PRAGMA user_version").fetchone()[0]
        if version > FORMAT:
            raise StoreError(
                f"the store {path} has format {version}, but this program knows formats up to "
                f"{FORMAT}: update it"
            )
        db.execute("PRAGMA journal_mode = WAL")
        db.execute(f"PRAGMA synchronous = {synchronous}")
        db.executescript(_TABLES)
    except BaseException:
        db.close()
        raise
    return db
