"""`SqliteStore`: one SQLite file, write-ahead logged, one transaction a batch."""

from __future__ import annotations

import logging
import os
import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from itertools import islice, takewhile
from pathlib import Path
from sys import intern
from typing import Self

from msgspec import structs

from fleet.errors import StoreError
from fleet.stores.durability import Durability
from fleet.stores.index import Index
from fleet.stores.journal import StoreJournal
from fleet.stores.receipts import ReceiptClock
from fleet.stores.state_file import (
    PAGES_AT_ONCE,
    blob_of,
    forgotten_of,
    identity_of,
    open_file,
    shrink,
    take_lock,
)
from keyexpr_schema.full_disk import FREE_SOME, is_full
from keyexpr_schema.transport.store.receipts import successor
from keyexpr_schema.transport.store.storage import (
    AppliedWrite,
    Changes,
    JournalQuery,
    Write,
    is_journaled,
)

_log = logging.getLogger(__name__)
_DAY_S = 86_400.0
_AT_ONCE = 1000


@dataclass(frozen=True)
class StoreMemory:
    """How long a store remembers what is over.

    A tombstone keeps an older value from coming back that arrives late: from a writer that tries
    again, or whose clock is behind. So it must outlive both by far, and clocks that differ by days
    are seen and set right; somebody who has not looked for longer than that lists everything anew.
    They are in memory, so a busy store forgets the oldest of more than `tombstones`.
    The journal is for people who ask what happened, and for earlier revisions of plans. What it
    takes in the file is its keys and values, and as much as a tenth besides.
    """

    journal_entries: int = 100_000
    journal_mb: float = 32.0
    journal_days: float = 30.0
    tombstones: int = 50_000
    tombstone_days: float = 7.0


class SqliteStore:
    """The `Store` of a router in the directory `data_dir`, which one process uses at a time.

    What was applied outlives the end of the process at any moment; once `sync` has returned a power
    cut, too. Where confirmed changes are missing, a warning says so and the store has a new
    identity, so that all who knew it list everything anew. `memory`: how long what is over is
    remembered.

    Raises:
        StoreInUse: another process has it open.
        StoreError: the directory or the file cannot be used; from `apply`, that nothing of the
            batch was applied.
    """

    def __init__(
        self,
        data_dir: Path,
        *,
        memory: StoreMemory | None = None,
        wall_time_s: Callable[[], float] = time.time,
    ) -> None:
        memory = memory or StoreMemory()
        self._wall_time_s = wall_time_s
        self._memory = memory
        self._lock = threading.Lock()
        path = data_dir / "state.sqlite"
        with ExitStack() as opened:
            opened.callback(os.close, take_lock(data_dir))
            try:
                self._db = opened.enter_context(closing(open_file(path)))
                self._forgotten = forgotten_of(self._db)
                self._tombstones: deque[tuple[float, int, str]] = deque()
                self._index, received = self._load()
                self._receipts = ReceiptClock(received, wall_time_s())
                self._durability = Durability(path, lambda: self._index.last)
                opened.callback(self._durability.close)
                missing = self._durability.missing()
                self._identity = identity_of(self._db, path, lacks=missing > 0)
                if missing:
                    _log.warning("%s", _lacking(path, missing))
                self._journal = StoreJournal(
                    self._db,
                    path,
                    entries=memory.journal_entries,
                    size_bytes=memory.journal_mb * 2**20,
                    age_s=memory.journal_days * _DAY_S,
                )
                opened.callback(self._journal.close)
            except (sqlite3.Error, OSError) as error:
                what = FREE_SOME if is_full(error) else "move it away to begin with an empty one"
                raise StoreError(f"the store {path} cannot be used ({error}): {what}") from None
            self._opened = opened.pop_all()

    def sync(self) -> None:
        """Return when all that was applied before is on the disk.

        Raises:
            StoreError: the disk does not say so.
        """
        try:
            self._durability.sync()
        except OSError as error:
            raise StoreError(f"the store could not write: {error.strerror}") from error

    def _load(self) -> tuple[Index, int]:
        """What is stored, and the last receipt."""
        rows = self._db.execute(
            "SELECT number, keyexpr, stamp, deleted, encoding, data, wall_time_s, received "
            "FROM latest"
        ).fetchall()
        rows.sort()
        index, last = Index(self._forgotten), 0
        for number, keyexpr, stamp, deleted, encoding, data, wall_time_s, received in rows:
            at = int.from_bytes(stamp, "big")
            write = Write(keyexpr, at, bool(deleted), intern(encoding), data, 0, received)
            index.set(number, write)
            last = max(last, received)
            if deleted:
                self._tombstones.append((wall_time_s, number, keyexpr))
        return index, last

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
                        "INSERT OR REPLACE INTO latest VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                        [
                            (
                                *(w.keyexpr, blob_of(w.stamp), w.deleted, w.encoding, w.data),
                                *(n, now_s, w.received),
                            )
                            for n, w in fresh
                        ],
                    )
                    pruned = self._journal.add(journaled, now_s)
                    faded = self._fade(now_s)
            except sqlite3.Error as error:
                raise StoreError(f"the store could not write: {error}") from error
            # Only now: what a reader sees must be durable.
            self._journal.added()
            for number, write in fresh:
                self._index.set(number, write)
                if write.deleted:
                    self._tombstones.append((now_s, number, write.keyexpr))
            for number, keyexpr in faded:
                self._tombstones.popleft()
                if self._index.number(keyexpr) == number:
                    self._index.forget(keyexpr)
                self._forgotten = max(self._forgotten, number)
            if pruned:
                with suppress(sqlite3.Error):  # another time will do
                    shrink(self._db, PAGES_AT_ONCE)
            return len(changes)

    def _decide(self, batch: Sequence[Write]) -> list[Write]:
        """The writes of `batch` that win, in their order."""
        fresh: dict[str, Write] = {}
        changes: list[Write] = []
        for write in batch:
            for one in (write,) if "*" not in write.keyexpr else self._concrete(write, fresh):
                known = fresh.get(one.keyexpr) or self._index.get(one.keyexpr)
                if not one.received:
                    one = structs.replace(one, received=self._receipts.now())
                if (taken := successor(one, known)) is not None:
                    fresh[one.keyexpr] = taken
                    changes.append(taken)
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
        return [structs.replace(write, keyexpr=key) for key in sorted(keys)]

    def _fade(self, now_s: float) -> list[tuple[int, str]]:
        """Delete from the file tombstones that are too old or too many, some at a time: which."""
        before_s = now_s - self._memory.tombstone_days * _DAY_S
        spare = len(self._tombstones) - self._memory.tombstones
        old = takewhile(
            lambda each: each[0] < spare or each[1][0] < before_s, enumerate(self._tombstones)
        )
        faded = [(number, keyexpr) for _, (_, number, keyexpr) in islice(old, _AT_ONCE)]
        if faded:
            self._db.executemany("DELETE FROM latest WHERE number = ? AND keyexpr = ?", faded)
            self._db.execute(
                "INSERT OR REPLACE INTO about VALUES ('forgotten', ?)",
                (str(max(self._forgotten, *(number for number, _ in faded))),),
            )
        return faded

    def select(self, pattern: str) -> list[Write]:
        with self._lock:
            return self._index.matching(pattern)

    def receipt(self) -> int:
        with self._lock:
            return self._receipts.now()

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

    def journal(self, realm: str, asked: JournalQuery) -> tuple[list[AppliedWrite], int]:
        return self._journal.entries(realm, asked), self._journal.last

    def close(self) -> None:
        """Release everything; what was applied stays."""
        with self._lock:
            self._opened.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _lacking(path: Path, missing: int) -> str:
    return (
        f"the last {missing} changes that the store {path} had confirmed are missing: its log "
        f"{path.name}-wal was deleted, emptied or cut, or the file is an older copy; whoever wrote "
        "them has to write them again, which the planner and the workers do by themselves"
    )
