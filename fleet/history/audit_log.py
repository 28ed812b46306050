"""The audit log: a file with a line of JSON for each thing that somebody did. It only grows.

It is opened for appending alone, so the file system may be told to allow nothing else
(`chattr +a`). No retention cuts it and no start reads more than its end. What the disk has no room
for is kept and written later.
"""

from __future__ import annotations

import logging
import os
import re
import threading
from collections.abc import Iterator
from pathlib import Path

import msgspec

from fleet.errors import StoreError
from keyexpr_schema.decoding import decode
from keyexpr_schema.payloads.audit import AuditAction, AuditEntry, AuditPage, AuditQuery
from keyexpr_schema.private_files import open_private

FILE = "audit.jsonl"
_TAIL_BYTES = 1 << 20
"""Of the end of the file, what a start looks at; all that a journal can still replay is there."""
_REMEMBERED = 20_000
"""Entries that are not written a second time; a journal is replayed from much later on."""
_BLOCK = 1 << 16
_WORD = re.compile(r"[\w.-]+")

log = logging.getLogger(__name__)


class AuditLog:
    """Appends entries, and finds them; use in a `with` block.

    Raises:
        StoreError: on entering, if the file cannot be opened.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        self._unwritten: list[bytes] = []
        self._writing = threading.Lock()
        self._torn = False
        self._dirty = False
        self._heard: dict[tuple[str, float], None] = {}
        self._latest: dict[str, AuditEntry] = {}
        """Of the newest entries: by key and moment, and what was said last of each key."""

    def __enter__(self) -> AuditLog:
        try:
            self._file = open_private(self._path, os.O_APPEND | os.O_WRONLY)
            with self._path.open("rb") as whole:
                end = whole.seek(0, os.SEEK_END)
                whole.seek(max(0, end - _TAIL_BYTES))
                tail = whole.read()
        except OSError as error:
            raise StoreError(
                f"the audit log {self._path} cannot be used: {error.strerror}; it is a file that "
                "the planner reads and appends to"
            ) from None
        self._torn = bool(tail) and not tail.endswith(b"\n")
        for line in tail.splitlines():
            if (entry := _decoded(line)) is not None:
                self._note(entry)
        return self

    def __exit__(self, *_: object) -> None:
        self.sync()
        os.close(self._file)

    def add(self, entry: AuditEntry) -> bool:
        """Append an entry, unless the log has it: the same moment of the same key, or what it says
        last of that key; whether it was appended."""
        if (entry.key, entry.wall_time_s) in self._heard:
            return False
        known = self._latest.get(entry.key)
        if known is not None and (known.action, known.digest) == (entry.action, entry.digest):
            return False
        self._note(entry)
        self._unwritten.append(msgspec.json.encode(entry) + b"\n")
        self._write()
        return True

    def has_deletion(self, key: str, since_wall_s: float) -> bool:
        """Whether the last that it says of a key is that it was deleted, at that time or later."""
        known = self._latest.get(key)
        return (
            known is not None
            and known.action is AuditAction.DELETED
            and known.wall_time_s >= since_wall_s
        )

    def sync(self) -> None:
        """Have everything that was appended on disk; may be called in a thread."""
        self._write()
        if self._dirty:
            self._dirty = False
            try:
                os.fsync(self._file)
            except OSError as error:
                self._dirty = True
                log.warning("the audit log %s is not safe on disk yet: %s", self._path, error)

    def page(self, query: AuditQuery) -> AuditPage:
        """The newest entries that the query is for, newest first; may be called in a thread."""
        found: list[AuditEntry] = []
        for line in self._backwards():
            entry = _decoded(line)
            if entry is None:
                continue
            if query.since_wall_s is not None and entry.wall_time_s < query.since_wall_s:
                break
            if _matches(entry, query):
                if len(found) == query.limit:
                    return AuditPage(entries=tuple(found), more=True)
                found.append(entry)
        return AuditPage(entries=tuple(found))

    def _note(self, entry: AuditEntry) -> None:
        self._heard[entry.key, entry.wall_time_s] = None
        self._latest.pop(entry.key, None)
        self._latest[entry.key] = entry
        if len(self._heard) > _REMEMBERED:
            del self._heard[next(iter(self._heard))]
        if len(self._latest) > _REMEMBERED:
            del self._latest[next(iter(self._latest))]

    def _write(self) -> None:
        with self._writing:
            self._write_what_there_is_room_for()

    def _write_what_there_is_room_for(self) -> None:
        while self._unwritten:
            line = (b"\n" if self._torn else b"") + self._unwritten[0]
            try:
                written = os.write(self._file, line)
            except OSError as error:
                log.warning("the audit log %s waits for room: %s", self._path, error)
                return
            self._dirty = True
            self._torn = written < len(line)  # the rest of such a line is of no use
            if not self._torn:
                self._unwritten.pop(0)

    def _backwards(self) -> Iterator[bytes]:
        """The lines of the file, the last one first."""
        with self._path.open("rb") as whole:
            end, rest = whole.seek(0, os.SEEK_END), b""
            while end:
                start = max(0, end - _BLOCK)
                whole.seek(start)
                lines = (whole.read(end - start) + rest).split(b"\n")
                rest, end = lines.pop(0), start
                yield from reversed(lines)
            yield rest


def _decoded(line: bytes) -> AuditEntry | None:
    try:
        return decode(line, AuditEntry)
    except msgspec.DecodeError:
        return None  # torn by a power cut


def _matches(entry: AuditEntry, query: AuditQuery) -> bool:
    by, about = query.by, query.about
    if by is not None and by.casefold() not in entry.by.casefold():
        return False
    if about is None or about in entry.key.split("/"):
        return True
    return about in (word.strip(".") for word in _WORD.findall(entry.summary))
