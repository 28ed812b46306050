"""The order journal: what must survive a crash of the worker, in one SQLite file a robot.

WAL with `synchronous=FULL`: when a method returns, what it wrote is on the disk, even if the power
goes. That costs a few milliseconds a write, and there are some three writes an attempt. The file
is held exclusively while it is open: two workers for one robot cannot both move it.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import msgspec

from keyexpr_schema.key import Payload
from keyexpr_schema.payloads.tasks import Order, Report
from keyexpr_schema.payloads.world import Fact
from workers.errors import JournalBusy, JournalUnreadable
from workers.orders.fencing import Attempt, AttemptName, Ledger, Phase, attempt_name

VERSION = 1
_TABLES = """
CREATE TABLE IF NOT EXISTS fence (
    name TEXT PRIMARY KEY,            -- '' for the epoch, else a plan
    highest INTEGER NOT NULL
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS attempt (
    number INTEGER PRIMARY KEY,       -- order of arrival
    plan TEXT NOT NULL, task TEXT NOT NULL, attempt INTEGER NOT NULL,
    phase TEXT NOT NULL, "order" BLOB NOT NULL, report BLOB,
    UNIQUE (plan, task, attempt)
);
CREATE TABLE IF NOT EXISTS outbox (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    kind TEXT NOT NULL,               -- 'fact' or 'report'
    payload BLOB NOT NULL
);
"""
_KINDS: dict[str, type[Payload]] = {"fact": Fact, "report": Report}


@dataclass(frozen=True)
class Unsent:
    """Something that must be read back from the store before it may be forgotten.

    `earlier_run`: a run of the worker before this one wrote it.
    """

    number: int
    payload: Fact | Report
    earlier_run: bool


class Journal:
    """Orders, attempts and unsent facts and reports of one robot. Use it as a context manager.

    `ledger` holds the same attempts in memory; the journal keeps the two in step. At opening,
    attempts that were queued are forgotten: their orders, if they still stand, arrive again.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.ledger = Ledger()
        self._db: sqlite3.Connection | None = None
        self._earlier = 0

    def __enter__(self) -> Self:
        """Open the file, or make it.

        Raises:
            JournalBusy: another process has it open.
            JournalUnreadable: it is not a journal, or one of another version.
        """
        self.path.parent.mkdir(parents=True, exist_ok=True)
        db = sqlite3.connect(self.path, timeout=0.5, isolation_level=None)
        try:
            db.execute("PRAGMA locking_mode=EXCLUSIVE")
            db.execute("PRAGMA journal_mode=WAL")
            db.execute("PRAGMA synchronous=FULL")
            db.execute("BEGIN IMMEDIATE")
            (version,) = db.execute("PRAGMA user_version").fetchone()
            if version not in (0, VERSION):
                raise JournalUnreadable(
                    f"{self.path} is an order journal of version {version}, this worker reads "
                    f"version {VERSION}: give the worker another data directory"
                )
            db.execute(f"PRAGMA user_version={VERSION}")
            for statement in _TABLES.split(";"):
                db.execute(statement)
            db.execute("DELETE FROM attempt WHERE phase=?", (Phase.QUEUED.value,))
            self._load(db)
            db.execute("COMMIT")
        except sqlite3.OperationalError as error:
            db.close()
            if "locked" not in str(error):
                raise JournalUnreadable(f"{self.path} cannot be opened: {error}") from None
            raise JournalBusy(
                f"{self.path} is in use: another worker runs for this robot with the same data "
                "directory; stop that one first"
            ) from None
        except (sqlite3.DatabaseError, msgspec.DecodeError) as error:
            db.close()
            raise JournalUnreadable(f"{self.path} is not an order journal: {error}") from None
        except BaseException:
            db.close()
            raise
        self._db = db
        return self

    def __exit__(self, *_: object) -> None:
        if self._db is not None:
            self._db.close()
            self._db = None

    def queued(self, order: Order) -> None:
        """An order was accepted."""
        with self._transaction():
            self._write(Attempt(order=order, phase=Phase.QUEUED))

    def renewed(self, order: Order) -> None:
        """A newer order for an attempt that is queued or running.

        A running attempt stays what it was when it started; only the fences go up.
        """
        attempt = self.ledger.attempts[attempt_name(order)]
        known = order if attempt.phase is Phase.QUEUED else attempt.order
        with self._transaction():
            self._fence(order)
            self._write(Attempt(order=known, phase=attempt.phase))
        self.ledger.raise_fences(order)

    def started(self, order: Order, report: Report) -> None:
        """The attempt is about to move the robot. Returns when that is on the disk."""
        with self._transaction():
            self._write(Attempt(order=order, phase=Phase.STARTED))
            self._send(report)

    def ended(self, order: Order, report: Report) -> None:
        """The attempt has ended; its facts, then its report, wait to be sent."""
        with self._transaction():
            self._write(Attempt(order=order, phase=Phase.ENDED, report=report))
            for fact in report.facts:
                self._send(fact)
            self._send(report)

    def dropped(self, name: AttemptName) -> None:
        """The order of a queued attempt was withdrawn."""
        self.ledger.drop(name)
        self._connection.execute(
            "DELETE FROM attempt WHERE plan=? AND task=? AND attempt=? AND phase=?",
            (*name, Phase.QUEUED.value),
        )

    def send(self, *payloads: Fact | Report) -> None:
        """Facts and reports that belong to no end of an attempt wait to be sent, in this order."""
        with self._transaction():
            for payload in payloads:
                self._send(payload)

    def unsent(self) -> Unsent | None:
        """The oldest fact or report that waits to be sent.

        A report with a later one of the same attempt behind it is passed over and forgotten.
        """
        while True:
            row = self._connection.execute(
                "SELECT number, kind, payload FROM outbox ORDER BY number LIMIT 1"
            ).fetchone()
            if row is None:
                return None
            number, kind, data = row
            payload = msgspec.json.decode(data, type=_KINDS[kind])
            assert isinstance(payload, (Fact, Report))
            if not self._overtaken(number, payload):
                return Unsent(number, payload, earlier_run=number <= self._earlier)
            self.sent(number)

    def sent(self, number: int) -> None:
        """It was read back from the store."""
        self._connection.execute("DELETE FROM outbox WHERE number=?", (number,))

    @property
    def _connection(self) -> sqlite3.Connection:
        if self._db is None:
            raise RuntimeError("the journal is not open: use it in a `with`")
        return self._db

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._connection.execute("ROLLBACK")
            raise
        self._connection.execute("COMMIT")

    def _overtaken(self, number: int, payload: Fact | Report) -> bool:
        if isinstance(payload, Fact):
            return False
        rows = self._connection.execute(
            "SELECT payload FROM outbox WHERE number>? AND kind='report'", (number,)
        )
        name = (payload.plan, payload.task, payload.attempt)
        later = (msgspec.json.decode(data, type=Report) for (data,) in rows.fetchall())
        return any((r.plan, r.task, r.attempt) == name for r in later)

    def _send(self, payload: Fact | Report) -> None:
        kind = "fact" if isinstance(payload, Fact) else "report"
        self._connection.execute(
            "INSERT INTO outbox (kind, payload) VALUES (?, ?)",
            (kind, msgspec.json.encode(payload)),
        )

    def _fence(self, order: Order) -> None:
        self._connection.executemany(
            "INSERT INTO fence VALUES (?, ?) ON CONFLICT (name) "
            "DO UPDATE SET highest = max(highest, excluded.highest)",
            (("", order.epoch), (order.plan, order.revision)),
        )

    def _write(self, attempt: Attempt) -> None:
        order = attempt.order
        self._fence(order)
        self._connection.execute(
            'INSERT INTO attempt (plan, task, attempt, phase, "order", report) '
            "VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT (plan, task, attempt) DO UPDATE SET "
            'phase=excluded.phase, "order"=excluded."order", report=excluded.report',
            (
                *attempt_name(order),
                attempt.phase.value,
                msgspec.json.encode(order),
                None if attempt.report is None else msgspec.json.encode(attempt.report),
            ),
        )
        self.ledger.put(attempt)

    def _load(self, db: sqlite3.Connection) -> None:
        for name, highest in db.execute("SELECT name, highest FROM fence"):
            if name:
                self.ledger.revisions[name] = highest
            else:
                self.ledger.epoch = highest
        rows = db.execute('SELECT phase, "order", report FROM attempt ORDER BY number')
        for phase, order, report in rows:
            self.ledger.put(
                Attempt(
                    order=msgspec.json.decode(order, type=Order),
                    phase=Phase(phase),
                    report=None if report is None else msgspec.json.decode(report, type=Report),
                )
            )
        (self._earlier,) = db.execute("SELECT coalesce(max(number), 0) FROM outbox").fetchone()
