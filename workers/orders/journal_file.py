"""The order journal's file: its tables, and how those of an earlier version become these."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from pathlib import Path

from keyexpr_schema.decoding import decode
from keyexpr_schema.full_disk import FREE_SOME, is_full
from keyexpr_schema.payloads.tasks import Order, Report
from keyexpr_schema.payloads.world import Fact
from workers.errors import JournalBusy, JournalFull, JournalUnreadable, WorkerError
from workers.orders.boots import TABLE, Boot, carry_over
from workers.orders.fencing import Attempt, Ledger, Phase, PlanName, TaskName

VERSION = 2
_TABLES = """
CREATE TABLE IF NOT EXISTS fence (
    scope TEXT NOT NULL,              -- 'epoch', 'revision', 'attempt' or 'serial'
    planner TEXT NOT NULL,            -- the lineage, '' for none
    plan TEXT NOT NULL, task TEXT NOT NULL,
    highest INTEGER NOT NULL,
    PRIMARY KEY (scope, planner, plan, task)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS attempt (
    number INTEGER PRIMARY KEY,       -- order of arrival
    planner TEXT NOT NULL,            -- the lineage, '' for none
    plan TEXT NOT NULL, task TEXT NOT NULL, attempt INTEGER NOT NULL,
    phase TEXT NOT NULL, "order" BLOB NOT NULL, report BLOB,
    ended_at REAL,                    -- Unix seconds
    UNIQUE (planner, plan, task, attempt)
);
CREATE TABLE IF NOT EXISTS call (       -- of programs under way: the calls that have ended
    planner TEXT NOT NULL, plan TEXT NOT NULL, task TEXT NOT NULL, attempt INTEGER NOT NULL,
    number INTEGER NOT NULL, finished BLOB NOT NULL,
    PRIMARY KEY (planner, plan, task, attempt, number)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS refused (    -- facts that the store has no room for
    relation TEXT NOT NULL, subject TEXT NOT NULL,
    payload BLOB NOT NULL, noted_s REAL,
    PRIMARY KEY (relation, subject)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS outbox (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    kind TEXT NOT NULL,               -- 'fact' or 'report'
    payload BLOB NOT NULL,
    noted_s REAL                      -- when, see `running_s`
);
"""
_FROM_VERSION_1 = """
INSERT INTO fence SELECT CASE name WHEN '' THEN 'epoch' ELSE 'revision' END, '', name, '', highest
    FROM fence_1;
INSERT INTO attempt SELECT number, '', plan, task, attempt, phase, "order", report,
    CASE phase WHEN 'ended' THEN CAST(strftime('%s', 'now') AS REAL) END
    FROM attempt_1;
DROP TABLE fence_1;
DROP TABLE attempt_1;
"""


def connected(path: Path) -> sqlite3.Connection:
    """The file, held exclusively from its first transaction on.

    Raises:
        sqlite3.Error: it cannot be used.
    """
    db = sqlite3.connect(path, timeout=0.5, isolation_level=None, check_same_thread=False)
    try:
        db.execute("PRAGMA locking_mode=EXCLUSIVE")
        db.execute("PRAGMA journal_mode=WAL")
        db.execute("PRAGMA synchronous=FULL")
    except BaseException:
        db.close()
        raise
    return db


def trouble_of(path: Path, error: Exception) -> WorkerError:
    """What an error means that the journal in `path` brought, for a person."""
    if is_full(error):
        return JournalFull(f"{path} cannot be written: {error}; {FREE_SOME}")
    if not isinstance(error, sqlite3.OperationalError):
        return JournalUnreadable(
            f"{path} is not an order journal, or a damaged one ({error}): move it away to begin "
            "with an empty one; what the robot had begun is then begun again, where it is still "
            "ordered"
        )
    if "locked" not in str(error):
        return JournalUnreadable(f"{path} cannot be opened: {error}")
    return JournalBusy(
        f"{path} is in use: another worker runs for this robot with the same data directory; stop "
        "that one first"
    )


def prepare_tables(db: sqlite3.Connection) -> int:
    """Make the tables, inside the caller's transaction; the version that the file had.

    A file of a version that is not known is left as it is: the caller compares.
    """
    (version,) = db.execute("PRAGMA user_version").fetchone()
    if version not in (0, 1, VERSION):
        return int(version)
    if version == 1:
        db.execute("ALTER TABLE fence RENAME TO fence_1")
        db.execute("ALTER TABLE attempt RENAME TO attempt_1")
    _run(db, _TABLES)
    if version == 1:
        _run(db, _FROM_VERSION_1)
    if "noted_s" not in {row[1] for row in db.execute("PRAGMA table_info(outbox)")}:
        db.execute("ALTER TABLE outbox ADD COLUMN noted_s REAL")  # of a version before
    _run(db, TABLE)
    carry_over(db, Boot.now())
    db.execute(f"PRAGMA user_version={VERSION}")
    return VERSION


def read_ledger(db: sqlite3.Connection, ledger: Ledger) -> None:
    """Put what the file has of fences and attempts into an empty ledger.

    Raises:
        msgspec.DecodeError: an order or a report is damaged.
    """
    for scope, lineage, plan, task, highest in db.execute(
        "SELECT scope, planner, plan, task, highest FROM fence"
    ):
        planner = lineage or None
        if scope == "epoch":
            ledger.epoch = highest
        elif scope == "revision":
            ledger.revisions[PlanName(planner, plan)] = highest
        elif scope == "serial":
            ledger.forgotten[planner] = highest
        else:
            ledger.unnumbered[TaskName(planner, plan, task)] = highest
    rows = db.execute('SELECT phase, "order", report, ended_at FROM attempt ORDER BY number')
    for phase, order, report, ended_at in rows:
        ledger.put(
            Attempt(
                order=decode(order, Order),
                phase=Phase(phase),
                report=None if report is None else decode(report, Report),
                ended_wall_s=ended_at,
            )
        )


def read_outbox(
    db: sqlite3.Connection, after: int = 0, most: int = -1
) -> Iterator[tuple[int, Fact | Report, float | None]]:
    """What waits to be sent after that number, in its order: the number, and when it was noted.

    Raises:
        msgspec.DecodeError: one is damaged.
    """
    rows = db.execute(
        "SELECT number, kind, payload, noted_s FROM outbox WHERE number>? ORDER BY number LIMIT ?",
        (after, most),
    )
    for number, kind, data, noted_s in rows:
        payload = decode(data, Fact) if kind == "fact" else decode(data, Report)
        yield number, payload, noted_s


def _run(db: sqlite3.Connection, script: str) -> None:
    # `executescript` would end the transaction.
    for statement in script.split(";"):
        db.execute(statement)
