"""Putting a store right in which values have stamps that are still to come.

Somebody's clock was ahead. What it wrote has a stamp from then, and hides whatever is written to
the same key until that time has come. Each such value gets a stamp of now, in the order of the
stamps that they had: so everybody's next write holds again, and no value changes.
"""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from fleet.errors import StoreError
from fleet.stores.state_file import blob_of, open_file, take_lock
from keyexpr_schema.transport.stamps import (
    source_of_stamp,
    stamp_of,
    ticks_of_time,
    time_s_of_stamp,
)


@dataclass(frozen=True)
class Ahead:
    """A key, realm included, whose newest write was stamped `ahead_s` from now."""

    key: str
    ahead_s: float
    deleted: bool


def stamped_ahead(data_dir: Path, now_s: float) -> list[Ahead]:
    """What a store holds that has a stamp later than `now_s` [s, Unix], the earliest first.

    Raises:
        StoreInUse: a router has it open.
        StoreError: there is none, or it cannot be read.
    """
    return _at_store(data_dir, now_s, repair=False)


def repair(data_dir: Path, now_s: float) -> list[Ahead]:
    """Give what is `stamped_ahead` stamps of now; what that was.

    All who knew the store list it anew: it has a new identity. Times at which something was
    written that are still to come become now.

    Raises:
        StoreInUse, StoreError: as `stamped_ahead`, or it cannot be written; then nothing is.
    """
    return _at_store(data_dir, now_s, repair=True)


def _at_store(data_dir: Path, now_s: float, *, repair: bool) -> list[Ahead]:
    path = data_dir / "state.sqlite"
    if not path.exists():
        raise StoreError(
            f"there is no store in {data_dir}: name the folder of the router that keeps it with "
            "--data, on its host"
        )
    guard = take_lock(data_dir)
    try:
        with closing(open_file(path)) as db:
            db.execute("PRAGMA synchronous = FULL")
            rows = db.execute(
                "SELECT keyexpr, stamp, deleted FROM latest WHERE stamp >= ? ORDER BY stamp",
                (blob_of(stamp_of(ticks_of_time(now_s), 0)),),
            ).fetchall()
            if repair and rows:
                _restamp(db, rows, now_s)
    except sqlite3.Error as error:
        raise StoreError(f"the store {path} cannot be put right: {error}") from None
    finally:
        os.close(guard)
    return [
        Ahead(key, time_s_of_stamp(int.from_bytes(stamp, "big")) - now_s, bool(deleted))
        for key, stamp, deleted in rows
    ]


def _restamp(db: sqlite3.Connection, rows: list[tuple[str, bytes, int]], now_s: float) -> None:
    first = ticks_of_time(now_s) - len(rows)
    changed = [
        (blob_of(stamp_of(first + n, source_of_stamp(int.from_bytes(stamp, "big")))), key)
        for n, (key, stamp, _) in enumerate(rows)
    ]
    with db:
        db.executemany("UPDATE latest SET stamp = ? WHERE keyexpr = ?", changed)
        for table in ("latest", "journal"):
            db.execute(f"UPDATE {table} SET wall_time_s = min(wall_time_s, ?)", (now_s,))
        db.execute("DELETE FROM about WHERE name = 'place'")
