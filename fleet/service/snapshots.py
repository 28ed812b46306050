"""Snapshots: the planner's state as it was after some event, each in a file of its own.

A file is written beside its place and moved there when it is on disk, so one that is there is
whole. Two are kept: should the newer one not be readable, the older one is, with the events since.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, get_args, get_origin

import msgspec
from msgspec.structs import replace

from fleet.core.state import State
from fleet.core.table import Table, decode_table, encode_table
from keyexpr_schema.private_files import write_private

log = logging.getLogger(__name__)

SNAPSHOT_FORMAT = 5
"""Counts up whenever a field of the state gets another name or meaning."""
_WITH_REASONS = 4
_READABLE = frozenset({2, 3, _WITH_REASONS, SNAPSHOT_FORMAT})
"""Formats that decode; in format 2 a state had no skills, before format 4 no reasons and wishes."""
KEPT = 2
_PREFIX, _SUFFIX = "snapshot-", ".msgpack"
_TABLE = 1
"""Code of the MessagePack extension that a table is written as."""
_ENTRIES_AT_ONCE = 200
"""Entries of a table that are written without a pause: other threads wait for about 0.2 ms."""


class Snapshot(msgspec.Struct, frozen=True, kw_only=True):
    """A kept state. What was kept before there was a format does not decode.

    `number` is that of the event that led to it, `unconfirmed` are the key expressions of
    deletions and of the planner's own facts that the store had not confirmed by then.
    """

    format: int = SNAPSHOT_FORMAT
    state: State
    number: int = 0
    unconfirmed: tuple[str, ...] = ()


class _Format(msgspec.Struct, frozen=True):
    format: int


def encode_snapshot(snapshot: Snapshot) -> bytes:
    """A snapshot in MessagePack; in a thread it holds others up for some milliseconds at most."""
    bare = replace(snapshot, state=snapshot.state.bare())
    return msgspec.msgpack.encode(bare, enc_hook=_encode)


def decode_snapshot(data: bytes) -> Snapshot | None:
    """The snapshot in MessagePack, or None if this program cannot read it."""
    try:
        found = msgspec.msgpack.decode(data, type=_Format).format
        if found not in _READABLE:
            return None
        if found < _WITH_REASONS:
            bare = _of_earlier_format(msgspec.msgpack.decode(data))
        else:
            bare = msgspec.msgpack.decode(data, type=Snapshot, dec_hook=_decode)
    except (msgspec.DecodeError, LookupError, TypeError, AttributeError):
        return None
    return replace(bare, state=bare.state.reindexed())


def _encode(value: Any) -> Any:
    if not isinstance(value, Table):
        return encode_table(value)
    entries = list(value.items())
    pieces = [
        msgspec.msgpack.encode(entries[at : at + _ENTRIES_AT_ONCE], enc_hook=_encode)
        for at in range(0, len(entries), _ENTRIES_AT_ONCE)
    ]
    return msgspec.msgpack.Ext(_TABLE, msgspec.msgpack.encode(pieces))


def _decode(kind: Any, value: Any) -> Any:
    if get_origin(kind) is not Table or not isinstance(value, msgspec.msgpack.Ext):
        return decode_table(kind, value)
    decoder = _decoder(*get_args(kind))
    entries: dict[Any, Any] = {}
    for piece in msgspec.msgpack.decode(value.data, type=list[bytes]):
        entries.update(decoder.decode(piece))
    return Table(entries)


@lru_cache(maxsize=64)
def _decoder(key: Any, value: Any) -> msgspec.msgpack.Decoder[Any]:
    return msgspec.msgpack.Decoder(list[tuple[key, value]], dec_hook=_decode)


def _of_earlier_format(read: Any) -> Snapshot:
    state = read["state"]
    plans = {plan: _with_reasons(entry) for plan, entry in state["plans"].items()}
    read = {**read, "state": {**state, "plans": plans}}
    return msgspec.convert(read, Snapshot, dec_hook=decode_table)


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


class SnapshotFiles:
    """The snapshots in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def numbers(self) -> list[int]:
        """The numbers of the snapshots there are, the newest first."""
        return [number for number, _ in self._files()]

    def newest(self) -> Snapshot | None:
        """The newest snapshot that can be read."""
        for _, path in self._files():
            try:
                data = path.read_bytes()
            except OSError as error:
                log.warning("%s cannot be read: %s", path, error.strerror)
                continue
            if (snapshot := decode_snapshot(data)) is not None:
                return snapshot
        return None

    def write(self, snapshot: Snapshot) -> None:
        """Keep a snapshot, and of the older ones one; may be called in a thread.

        Raises:
            OSError: it could not be written; those there were are still there.
        """
        path = self._folder / f"{_PREFIX}{snapshot.number:012}{_SUFFIX}"
        write_private(path, encode_snapshot(snapshot))
        for _, path in list(self._files())[KEPT:]:
            path.unlink(missing_ok=True)

    def move_to(self, folder: Path) -> None:
        """Move all there are to another folder."""
        for _, path in list(self._files()):
            path.rename(folder / path.name)

    def tidy(self) -> None:
        """Delete what was not written to its end; for when nobody writes."""
        for path in self._folder.glob(f"{_PREFIX}*.new"):
            path.unlink(missing_ok=True)

    def _files(self) -> Iterator[tuple[int, Path]]:
        for path in sorted(self._folder.glob(f"{_PREFIX}*{_SUFFIX}"), reverse=True):
            number = path.name.removeprefix(_PREFIX).removesuffix(_SUFFIX)
            if number.isdecimal():
                yield int(number), path
