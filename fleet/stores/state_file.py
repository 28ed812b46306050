"""The SQLite file of a store: its lock, its tables, and how files of older formats are taken over.

Formats: 1 had no numbers of change and no `about`; 2 had no receipts.
"""

from __future__ import annotations

import fcntl
import os
import sqlite3
import time
import uuid
from pathlib import Path

from fleet.errors import StoreError, StoreInUse
from keyexpr_schema.private_files import open_private, private_database, usable_folder

FORMAT = 3
PAGES_AT_ONCE = 256
"""So many unused pages are given back at a time while the store is in use: a millisecond or two."""
_PAGES_WORTH_IT = 1000
"""A file with so many unused pages, more than are in use, is worth making smaller."""
_WAL_BYTES = 4_194_304
"""What is left of a write-ahead log that was larger for once."""
_INCREMENTAL = 2
_STAMP_BYTES = 24
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
_LATEST = """
CREATE TABLE IF NOT EXISTS latest (
    keyexpr TEXT PRIMARY KEY,
    stamp BLOB NOT NULL,
    deleted INTEGER NOT NULL,
    encoding TEXT NOT NULL,
    data BLOB NOT NULL,
    number INTEGER NOT NULL,
    wall_time_s REAL NOT NULL,
    received INTEGER NOT NULL
) WITHOUT ROWID;
"""
_TABLES = f"""
{_LATEST}
CREATE TABLE IF NOT EXISTS journal (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    wall_time_s REAL NOT NULL,
    keyexpr TEXT NOT NULL,
    deleted INTEGER NOT NULL,
    stamp BLOB NOT NULL,
    data BLOB NOT NULL
);
CREATE TABLE IF NOT EXISTS about (name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
PRAGMA user_version = {FORMAT};
"""


def take_lock(data_dir: Path) -> int:
    """A file descriptor that keeps other processes out of `data_dir` until it is closed.

    Raises:
        StoreInUse: another process has it.
        StoreError: the directory cannot be used.
    """
    with usable_folder(data_dir, "store", StoreError):
        guard = open_private(data_dir / "lock", os.O_RDWR)
    try:
        # The kernel drops the lock with the process, however it ends.
        fcntl.flock(guard, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(guard)
        raise StoreInUse(
            f"another router uses the store in {data_dir}: stop it, or name another folder "
            "with --data"
        ) from None
    return guard


def open_file(path: Path) -> sqlite3.Connection:
    """The database, with the tables of this format.

    Raises:
        StoreError: it is of a later format.
        sqlite3.Error, OSError: it cannot be used.
    """
    private_database(path)
    db = sqlite3.connect(path, check_same_thread=False, timeout=5.0)
    try:
        version = db.execute("PRAGMA user_version").fetchone()[0]
        if version > FORMAT:
            raise StoreError(
                f"the store {path} has format {version}, but this program knows formats up to "
                f"{FORMAT}: update it"
            )
        db.execute(f"PRAGMA auto_vacuum = {_INCREMENTAL}")  # of a file that is new
        db.execute("PRAGMA journal_mode = WAL")
        db.execute(f"PRAGMA journal_size_limit = {_WAL_BYTES}")
        db.execute("PRAGMA synchronous = NORMAL")  # see `Durability`
        if version in (1, 2):
            _convert_the_latest(db, version)
        db.executescript(_TABLES)
        shrink(db)
    except BaseException:
        db.close()
        raise
    return db


def shrink(db: sqlite3.Connection, pages: int | None = None) -> None:
    """Give the file system pages back that are not used, if there are more than are used.

    At most so many `pages`; None: all, which takes as long as what is in use takes to copy. Other
    unused pages are used again. Files of earlier versions can only give back all at once. Not in a
    transaction.
    """
    (unused,) = db.execute("PRAGMA freelist_count").fetchone()
    (there,) = db.execute("PRAGMA page_count").fetchone()
    if unused < _PAGES_WORTH_IT or 2 * unused < there:
        return
    (mode,) = db.execute("PRAGMA auto_vacuum").fetchone()
    if pages is None and mode != _INCREMENTAL:
        db.execute(f"PRAGMA auto_vacuum = {_INCREMENTAL}")
        db.execute("VACUUM")
    elif mode == _INCREMENTAL:
        # Not by `execute`, which takes one step, of one page.
        db.executescript(f"PRAGMA incremental_vacuum({pages or unused})")


def _convert_the_latest(db: sqlite3.Connection, version: int) -> None:
    """What was written before receipts counts as received when it was written."""
    since = {
        1: f"row_number() OVER (ORDER BY stamp), {time.time()}, row_number() OVER (ORDER BY stamp)",
        2: "number, wall_time_s, cast(wall_time_s * 1e6 AS INTEGER)",
    }[version]
    db.executescript(
        f"""
        BEGIN IMMEDIATE;
        ALTER TABLE latest RENAME TO latest_before;
        {_LATEST}
        INSERT INTO latest SELECT keyexpr, stamp, deleted, encoding, data, {since}
            FROM latest_before;
        DROP TABLE latest_before;
        PRAGMA user_version = {FORMAT};
        COMMIT;
        """
    )


def identity_of(db: sqlite3.Connection, path: Path, *, lacks: bool = False) -> str:
    """A name of the store that is new where changes that somebody saw may be missing.

    That is where the file was replaced or copied, where it `lacks` some, and where the power may
    have gone: the last writes before that, which nobody had asked about, may not be on the disk,
    and their numbers are used again.
    """
    file = path.stat()
    boot = _BOOT_ID.read_text().strip() if _BOOT_ID.exists() else uuid.uuid4().hex
    place = f"{boot}/{file.st_dev}/{file.st_ino}"
    about = dict(db.execute("SELECT name, value FROM about").fetchall())
    if lacks or about.get("place") != place:
        about["identity"] = uuid.uuid4().hex[:16]
        with db:
            db.executemany(
                "INSERT OR REPLACE INTO about VALUES (?, ?)",
                [("place", place), ("identity", about["identity"])],
            )
    return str(about["identity"])


def blob_of(stamp: int) -> bytes:
    """A stamp as a column has it: such blobs compare as the stamps do."""
    return stamp.to_bytes(_STAMP_BYTES, "big")


def forgotten_of(db: sqlite3.Connection) -> int:
    """The number of the newest deletion that is forgotten."""
    row = db.execute("SELECT value FROM about WHERE name = 'forgotten'").fetchone()
    return int(row[0]) if row is not None else 0
