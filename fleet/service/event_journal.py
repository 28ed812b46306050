"""The planner's event journal: every event that changed its state, in order, in SQLite.

An event is on disk before its effects leave the process, so a planner killed at any moment
replays to where it was. From time to time the whole state is kept beside it, so that a start takes
no longer the longer the planner has lived.
"""

from __future__ import annotations

import fcntl
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

import msgspec

from fleet.core.events import Event, decode_event, encode_event
from fleet.core.state import State
from fleet.core.table import decode_table, encode_table
from fleet.errors import FleetError

SNAPSHOT_FORMAT = 4
"""Counts up whenever a field of the state gets another name or meaning."""
_READABLE = frozenset({2, 3, SNAPSHOT_FORMAT})
"""Formats that decode; in format 2 a state had no skills, before format 4 no reasons and wishes."""
SNAPSHOT_EVERY = 2000
"""Events between two snapshots; replaying this many takes well under a second."""


class _Snapshot(msgspec.Struct, frozen=True, kw_only=True):
    """A kept state. What was kept before there was a format does not decode."""

    format: int
    state: State


class JournalInUse(FleetError):
    """Another planner works with this folder."""


class EventJournal:
    """Appends events and gives them back; use in a `with` block.

    Raises:
        JournalInUse: on entering, if another process has it.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock: TextIO | None = None
        self._since_snapshot = 0

    def __enter__(self) -> EventJournal:
        self._folder.mkdir(parents=True, exist_ok=True)
        lock = (self._folder / "lock").open("w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            raise JournalInUse(
                f"another planner works with {self._folder}: end it, or use another --data"
            ) from None
        self._lock = lock
        self._db = sqlite3.connect(self._folder / "events.db", isolation_level=None)
        self._db.execute("PRAGMA journal_mode=WAL")
        self._db.execute("PRAGMA synchronous=NORMAL")
        self._db.execute(
            "CREATE TABLE IF NOT EXISTS events (number INTEGER PRIMARY KEY, event BLOB NOT NULL)"
        )
        self._db.execute(
            "CREATE TABLE IF NOT EXISTS snapshots (number INTEGER PRIMARY KEY, state BLOB NOT NULL)"
        )
        return self

    def __exit__(self, *_: object) -> None:
        self._db.close()
        if self._lock is not None:
            self._lock.close()

    def append(self, event: Event, state: State) -> None:
        """Keep an event, and now and then the state that it led to."""
        cursor = self._db.execute("INSERT INTO events (event) VALUES (?)", (encode_event(event),))
        self._since_snapshot += 1
        if self._since_snapshot >= SNAPSHOT_EVERY:
            self._since_snapshot = 0
            kept = _Snapshot(format=SNAPSHOT_FORMAT, state=state.bare())
            self._db.execute("BEGIN")
            self._db.execute("DELETE FROM snapshots")
            self._db.execute(
                "INSERT INTO snapshots (number, state) VALUES (?, ?)",
                (cursor.lastrowid, msgspec.msgpack.encode(kept, enc_hook=encode_table)),
            )
            self._db.execute("COMMIT")

    @property
    def empty(self) -> bool:
        """Whether nothing was ever kept here."""
        return self._db.execute("SELECT 1 FROM events LIMIT 1").fetchone() is None

    def snapshot(self) -> tuple[int, State]:
        """The newest kept state and the number of the event that led to it (0: none is kept).

        A snapshot in another format, by an older version of the planner, counts as none.
        """
        row = self._db.execute("SELECT number, state FROM snapshots").fetchone()
        if row is None:
            return 0, State()
        try:
            read = msgspec.msgpack.decode(row[1])
            if read["format"] < SNAPSHOT_FORMAT:
                read["state"]["plans"] = {
                    plan: _with_reasons(entry) for plan, entry in read["state"]["plans"].items()
                }
            kept = msgspec.convert(read, _Snapshot, dec_hook=decode_table)
        except (msgspec.DecodeError, LookupError, TypeError, AttributeError):
            return 0, State()
        return (int(row[0]), kept.state.reindexed()) if kept.format in _READABLE else (0, State())

    def events(self, after: int = 0) -> Iterator[Event]:
        """Every event with a higher number than `after`, in order."""
        for (data,) in self._db.execute(
            "SELECT event FROM events WHERE number > ? ORDER BY number", (after,)
        ):
            yield decode_event(data)


def _with_reasons(entry: dict[str, Any]) -> dict[str, Any]:
    """What was kept of a plan before format 4: one reason to make it again, and one task to add."""
    job, replan, task = entry.get("job") or {}, entry.get("replan"), entry.get("amendment")
    found = {reason["number"]: reason for reason in (job.get("reason"), replan) if reason}
    wishes = []
    if task is not None:
        number = max(found)
        del found[number]
        wish = {"wish": "TaskAdded", "number": number, "request": entry["amendment_request"]}
        args = {name: value for name, value in task["args"].items() if name != "robot"}
        robot = entry["plan"]["pins"].get(task["actor"])
        wishes.append(
            {**wish, "skill": task["skill"], "args": args, "after": task["after"], "robot": robot}
        )
    if job.get("reason"):
        job = {**job, "request": None, "takes_up": [job["reason"]["number"]]}
    return {**entry, "job": job or None, "reasons": list(found.values()), "wishes": wishes}
