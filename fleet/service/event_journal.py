"""The planner's event journal: the events that changed its state, in order, in SQLite.

An event is on disk (`sync`) before its effects leave the process, so a planner that ends at any
moment, by a power cut, too, replays to where it was. Now and then the state is kept in a snapshot,
and the events below the last two snapshots are deleted: neither a start nor the file grows with the
planner's past. An event that the core could not handle is set aside, with what went wrong, and is
not handled again by the same logic.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import sqlite3
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from fleet.core.events import Event, decode_event, encode_event
from fleet.core.state import LOGIC, State
from fleet.errors import FleetError
from fleet.service.snapshots import KEPT, Snapshot, SnapshotFiles, decode_snapshot
from fleet.stores.synced_log import SyncedLog
from keyexpr_schema.full_disk import FREE_SOME, is_full
from keyexpr_schema.private_files import open_private, private_database, usable_folder

SET_ASIDE_KEPT = 1000
"""Events set aside that are remembered; the oldest are forgotten first."""
_PAGES_WORTH_IT = 1000
"""A file with so many unused pages, four times those in use, is made small again."""
FORMAT = 0
_TABLES = """
CREATE TABLE IF NOT EXISTS events (number INTEGER PRIMARY KEY, event BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS set_aside (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    digest TEXT NOT NULL UNIQUE,
    logic INTEGER NOT NULL,
    wall_time_s REAL NOT NULL,
    times INTEGER NOT NULL,
    event BLOB NOT NULL,
    traceback TEXT NOT NULL
);
"""


class JournalInUse(FleetError):
    """Another planner works with this folder."""


class JournalUnreadable(FleetError):
    """The journal cannot be opened, or needs another version of this program."""


class JournalEntry(NamedTuple):
    """An event and its number."""

    number: int
    event: Event


class EventJournal:
    """Appends events and gives them back; use in a `with` block.

    Raises:
        JournalInUse: on entering, if another process has it.
        JournalUnreadable: on entering, if the folder or the file cannot be used.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._file = folder / "events.db"
        self._snapshots = SnapshotFiles(folder)

    def __enter__(self) -> EventJournal:
        with ExitStack() as opened:
            with usable_folder(self._folder, "planner's", JournalUnreadable):
                lock = open_private(self._folder / "lock", os.O_RDWR)
                opened.callback(os.close, lock)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise JournalInUse(
                    f"another planner works with {self._folder}: end it, or use another --data"
                ) from None
            try:
                self._db = opened.enter_context(
                    closing(sqlite3.connect(private_database(self._file), isolation_level=None))
                )
                self._prepare()
                self._log = opened.enter_context(closing(SyncedLog(self._file)))
            except (sqlite3.Error, OSError) as error:
                what = "move it away, with the snapshots beside it, to begin with an empty one"
                raise JournalUnreadable(
                    f"the journal {self._file} cannot be used ({error}): "
                    f"{FREE_SOME if is_full(error) else what}"
                ) from None
            self._opened = opened.pop_all()
        return self

    def _prepare(self) -> None:
        (version,) = self._db.execute("PRAGMA user_version").fetchone()
        if version > FORMAT:
            raise JournalUnreadable(
                f"the journal {self._file} has format {version}, but this program knows formats up "
                f"to {FORMAT}: update it"
            )
        self._db.execute("PRAGMA journal_mode=WAL")
        self._db.execute("PRAGMA synchronous=NORMAL")
        self._db.execute("PRAGMA journal_size_limit=4194304")
        self._db.executescript(_TABLES)
        self._snapshots.tidy()
        last: int = self._db.execute("SELECT coalesce(max(number), 0) FROM events").fetchone()[0]
        self.last: int = max(last, *self._snapshots.numbers(), 0)
        """The number of the newest event."""
        self._set_aside = {
            digest
            for (digest,) in self._db.execute(
                "SELECT digest FROM set_aside WHERE logic = ?", (LOGIC,)
            )
        }

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    @property
    def empty(self) -> bool:
        """Whether nothing was ever kept here."""
        return self.last == 0

    def begin_anew(self) -> Path:
        """Begin with nothing; all that there was is kept in the folder that this returns."""
        stamp = time.strftime("%Y%m%d-%H%M%S", time.gmtime())
        kept = self._folder / f"set-back-{stamp}"
        kept.mkdir(mode=0o700)
        self._db.execute("VACUUM INTO ?", (str(kept / self._file.name),))
        self._snapshots.move_to(kept)
        self._db.execute("DELETE FROM events")
        self._db.execute("DROP TABLE IF EXISTS snapshots")
        self.sync()
        self.last = 0
        return kept

    # --- events ----------------------------------------------------------------------------------

    def sync(self) -> None:
        """Return when all that was appended before is on the disk; may be called in a thread.

        Raises:
            OSError: the system cannot say so.
        """
        self._log.sync()

    def append(self, event: Event) -> None:
        """Keep an event, which then outlives the process."""
        self.append_encoded(encode_event(event))

    def append_encoded(self, data: bytes) -> None:
        """Keep an event that is encoded already."""
        self._db.execute("INSERT INTO events VALUES (?, ?)", (self.last + 1, data))
        self.last += 1

    def events(self, after: int = 0) -> Iterator[JournalEntry]:
        """Every event with a higher number than `after`, in order.

        Raises:
            JournalUnreadable: one is damaged, or of another version of the program.
        """
        for number, data in self._db.execute(
            "SELECT number, event FROM events WHERE number > ? ORDER BY number", (after,)
        ):
            try:
                event = decode_event(data)
            except (msgspec.DecodeError, UnicodeDecodeError) as error:
                raise JournalUnreadable(
                    f"event {number} in {self._file} cannot be read by this version ({error}): "
                    "start the version that wrote it, or move the folder away to begin with what "
                    "the store has"
                ) from None
            yield JournalEntry(number, event)

    # --- snapshots -------------------------------------------------------------------------------

    def snapshot(self) -> Snapshot:
        """The newest snapshot that can be read; one of an empty state where all events are there.

        Raises:
            JournalUnreadable: none can be read, and the events before them are gone.
        """
        snapshot = self._snapshots.newest() or self._snapshot_in_table()
        if snapshot is not None:
            return snapshot
        (first,) = self._db.execute("SELECT min(number) FROM events").fetchone()
        if self._snapshots.numbers() and first != 1:
            raise JournalUnreadable(
                f"the planner's snapshots in {self._folder} cannot be read by this version: start "
                "the version that wrote them, or move the folder away to begin with what the store "
                "has"
            )
        return Snapshot(state=State())

    def _snapshot_in_table(self) -> Snapshot | None:
        """What earlier versions kept: a snapshot in a table, above all of its events."""
        if not self._db.execute("PRAGMA table_info(snapshots)").fetchone():
            return None
        row = self._db.execute("SELECT number, state FROM snapshots").fetchone()
        snapshot = decode_snapshot(row[1]) if row is not None else None
        return replace(snapshot, number=int(row[0])) if snapshot is not None else None

    def write_snapshot(self, snapshot: Snapshot) -> None:
        """Keep a snapshot; may be called in a thread. `cut` follows it, in the journal's own.

        Raises:
            OSError: it could not be written; those there were are still there.
        """
        self._snapshots.write(snapshot)

    def cut(self) -> None:
        """Delete the events that no kept snapshot needs, and give room back that is not used."""
        numbers = self._snapshots.numbers()
        if len(numbers) < KEPT:
            return  # the events are what a first snapshot is fallen back from
        self._db.execute("DELETE FROM events WHERE number <= ?", (min(numbers),))
        self._db.execute("DROP TABLE IF EXISTS snapshots")
        (unused,) = self._db.execute("PRAGMA freelist_count").fetchone()
        (pages,) = self._db.execute("PRAGMA page_count").fetchone()
        if unused > _PAGES_WORTH_IT and unused > 0.8 * pages:
            self._db.execute("VACUUM")

    # --- events set aside ------------------------------------------------------------------------

    def set_aside(self, event: Event, traceback: str) -> int:
        """Keep an event that the core could not handle beside the journal; how many there are."""
        digest = _digest(event)
        self._db.execute(
            "INSERT INTO set_aside (digest, logic, wall_time_s, times, event, traceback) "
            "VALUES (?, ?, ?, 1, ?, ?) ON CONFLICT (digest) DO UPDATE SET logic = excluded.logic, "
            "wall_time_s = excluded.wall_time_s, times = times + 1, traceback = excluded.traceback",
            (digest, LOGIC, time.time(), encode_event(event), traceback),
        )
        self._db.execute(
            "DELETE FROM set_aside WHERE number <= (SELECT max(number) FROM set_aside) - ?",
            (SET_ASIDE_KEPT,),
        )
        self._set_aside.add(digest)
        (count,) = self._db.execute("SELECT count(*) FROM set_aside").fetchone()
        return int(count)

    def is_set_aside(self, event: Event) -> bool:
        """Whether this logic of the core could not handle the same event before."""
        return bool(self._set_aside) and _digest(event) in self._set_aside

    def drop(self, number: int) -> None:
        """Take an event out of the journal."""
        self._db.execute("DELETE FROM events WHERE number = ?", (number,))


def _digest(event: Event) -> str:
    """What tells an event from others, whenever it comes."""
    timeless = replace(event, time_s=0.0, wall_time_s=0.0, monotonic_s=None)
    return hashlib.sha256(encode_event(timeless)).hexdigest()
