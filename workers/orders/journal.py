"""The order journal: what must survive a crash of the worker, in one SQLite file a robot.

WAL with `synchronous=FULL`: when a method returns, what it wrote is on the disk, even if the power
goes. That costs a few milliseconds a write, and there are some three writes an attempt. What may be
lost in a power cut without harm (that something was sent, or is over) does not wait for the disk,
and is not written where there is no room. All else is then as if it had not been asked for.
The file is held exclusively while it is open: two workers for one robot cannot both move it.
"""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Self

import msgspec
from msgspec.structs import replace

from keyexpr_schema.decoding import decode
from keyexpr_schema.full_disk import is_full
from keyexpr_schema.key import Payload
from keyexpr_schema.payloads.programs import ProgramCall
from keyexpr_schema.payloads.tasks import Order, Report
from keyexpr_schema.payloads.world import Fact
from keyexpr_schema.private_files import private_database, usable_folder
from workers.errors import JournalUnreadable
from workers.host_clock import running_s, since
from workers.orders.fencing import Attempt, AttemptName, Ledger, Phase
from workers.orders.journal_file import (
    VERSION,
    connected,
    prepare_tables,
    read_ledger,
    read_outbox,
    trouble_of,
)
from workers.orders.refused_facts import RefusedFacts
from workers.seen_facts import SeenFacts

_SEEN = 1000
_IS_ATTEMPT = "planner=? AND plan=? AND task=? AND attempt=?"


@dataclass(frozen=True)
class Unsent:
    """Something that must be read back from the store; noted `age_s` ago."""

    number: int
    payload: Fact | Report
    age_s: float


class FinishedCall(msgspec.Struct, frozen=True, kw_only=True):
    """A call of a program that has ended, and the facts that it brought."""

    call: ProgramCall
    facts: tuple[Fact, ...] = ()


@dataclass(frozen=True)
class Retention:
    """How many attempts that are over are kept, and for how long at most [s].

    An attempt is over when it has ended, its report is in the store, and its order is gone.
    """

    count: int = 100
    age_s: float = 7 * 24 * 3600.0


KEPT = Retention()


class Journal:
    """Orders, attempts and unsent facts and reports of one robot. Use it as a context manager.

    `ledger` holds the same attempts in memory; the journal keeps the two in step. At opening,
    attempts that were queued are forgotten: their orders, if they still stand, arrive again.

    What writes raises `sqlite3.Error` where there is no room (`keyexpr_schema.full_disk.is_full`),
    and may be called again.

    Opening blocks for as long as the file is read, and may be done in another thread; all else is
    for one thread at a time. `wall_s` gives Unix seconds.
    """

    def __init__(
        self,
        path: Path,
        retention: Retention = KEPT,
        wall_s: Callable[[], float] = time.time,
    ) -> None:
        self.path = path
        self.ledger = Ledger()
        self.seen = SeenFacts()
        """What was observed, and of that what is to be sent."""
        self._retention = retention
        self._wall_s = wall_s
        self._db: sqlite3.Connection | None = None
        self._reports: dict[int, AttemptName] = {}
        """The attempts of the reports that wait to be sent, by number."""
        self._last_report: dict[AttemptName, int] = {}
        self._sent = 0
        """The number of the last that was sent; it may still be in the file."""
        self._once_written: list[Callable[[], None]] = []
        """What a transaction changes in memory."""

    def __enter__(self) -> Self:
        """Open the file, or make it.

        Raises:
            JournalBusy: another process has it open.
            JournalFull: there is no room.
            JournalUnreadable: it is not a journal, or one of another version.
        """
        with usable_folder(self.path.parent, "worker's", JournalUnreadable):
            private_database(self.path)
        try:
            db = connected(self.path)
        except sqlite3.Error as error:
            raise trouble_of(self.path, error) from None
        try:
            db.execute("BEGIN IMMEDIATE")
            if (version := prepare_tables(db)) != VERSION:
                raise JournalUnreadable(
                    f"{self.path} is an order journal of version {version}, this worker reads "
                    f"version {VERSION}: give the worker another data directory"
                )
            db.execute("DELETE FROM attempt WHERE phase=?", (Phase.QUEUED.value,))
            self._load(db)
            self.refused = RefusedFacts(db, self.seen)
            db.execute("COMMIT")
        except (sqlite3.Error, msgspec.DecodeError, ValueError) as error:
            db.close()
            raise trouble_of(self.path, error) from None
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
        attempt = self.ledger.attempts[AttemptName.of(order)]
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

    def called(self, order: Order, finished: FinishedCall) -> None:
        """A call of the attempt's program has ended; its facts wait to be sent."""
        with self._transaction():
            self._connection.execute(
                "INSERT INTO call VALUES (?, ?, ?, ?, ?, ?)",
                (
                    *_row_of(AttemptName.of(order)),
                    finished.call.number,
                    msgspec.json.encode(finished),
                ),
            )
            for fact in finished.facts:
                self._send(fact)

    def calls(self, order: Order) -> tuple[FinishedCall, ...]:
        """The calls of the attempt's program that have ended, in their order."""
        rows = self._connection.execute(
            f"SELECT finished FROM call WHERE {_IS_ATTEMPT} ORDER BY number",
            _row_of(AttemptName.of(order)),
        )
        return tuple(decode(row, FinishedCall) for (row,) in rows)

    def ended(self, order: Order, report: Report) -> None:
        """The attempt has ended; its facts, then its report, wait to be sent."""
        said = {fact for finished in self.calls(order) for fact in finished.facts}
        report = replace(report, told=True)
        with self._transaction():
            self._connection.execute(
                f"DELETE FROM call WHERE {_IS_ATTEMPT}", _row_of(AttemptName.of(order))
            )
            self._write(Attempt(order, Phase.ENDED, report, self._wall_s()))
            for fact in report.facts:
                if fact not in said:  # once more it would be news
                    self._send(fact)
            self._send(report)

    def dropped(self, name: AttemptName) -> None:
        """The order of a queued attempt was withdrawn."""
        self.ledger.drop(name)
        with self._unhurried():
            self._delete(name, Phase.QUEUED)

    def forget(self, stands: Callable[[AttemptName], bool]) -> None:
        """Forget what has been over for too long, and the oldest of what is over beyond the count.

        `stands` says whether an attempt's order still does. Looks at no more than it forgets, and
        at what is not over yet.
        """
        attempts, keep = self.ledger.attempts, self._retention
        surplus = len(attempts) - keep.count
        before_s = self._wall_s() - keep.age_s
        over = []
        for name, attempt in attempts.items():
            ended_s = attempt.ended_wall_s
            if surplus <= 0 and ended_s is not None and ended_s >= before_s:
                break
            if ended_s is None or name in self._last_report or stands(name):
                continue
            if surplus > 0 or ended_s < before_s:
                over.append(name)
                surplus -= 1
        if over:
            with self._unhurried():
                for name in over:
                    self._forget(name)

    def is_confirmed(self, name: AttemptName) -> bool:
        """Whether no report of the attempt waits to be sent."""
        return name not in self._last_report

    def send(self, *payloads: Fact | Report, age_s: float = 0.0) -> None:
        """Facts and reports that belong to no end of an attempt wait to be sent, in this order."""
        with self._transaction():
            for payload in payloads:
                self._send(payload, age_s)

    def unsent(self) -> Unsent | None:
        """The oldest fact or report that waits to be sent.

        A report with a later one of the same attempt behind it is passed over and forgotten.
        """
        while True:
            found = next(read_outbox(self._connection, self._sent, 1), None)
            if found is None:
                return None
            number, payload, noted_s = found
            if not self._overtaken(number, payload):
                return Unsent(number, payload, since(noted_s))
            self.sent(number)

    def sent(self, number: int) -> None:
        """It was read back from the store."""
        self._sent = number
        with self._unhurried():
            self._connection.execute("DELETE FROM outbox WHERE number<=?", (number,))
        self.seen.sent(number)
        name = self._reports.pop(number, None)
        if name is not None and self._last_report.get(name) == number:
            del self._last_report[name]

    @property
    def _connection(self) -> sqlite3.Connection:
        if self._db is None:
            raise RuntimeError("the journal is not open: use it in a `with`")
        return self._db

    @contextmanager
    def _transaction(self, *, durable: bool = True) -> Iterator[None]:
        db = self._connection
        self._once_written.clear()
        db.execute(f"PRAGMA synchronous={'FULL' if durable else 'NORMAL'}")
        db.execute("BEGIN IMMEDIATE")
        try:
            yield
            db.execute("COMMIT")
        except BaseException:
            if db.in_transaction:  # for want of room, SQLite has taken it back by itself
                db.execute("ROLLBACK")
            raise
        for note in self._once_written:
            note()

    @contextmanager
    def _unhurried(self) -> Iterator[None]:
        """A transaction that may be lost without harm: done in memory, whatever the disk has."""
        try:
            with self._transaction(durable=False):
                yield
        except sqlite3.Error as error:
            if not is_full(error):
                raise

    def _overtaken(self, number: int, payload: Fact | Report) -> bool:
        if isinstance(payload, Fact):
            return False
        return self._last_report[AttemptName.of(payload)] != number

    def _send(self, payload: Fact | Report, age_s: float = 0.0) -> None:
        kind, noted_s = "report", running_s() - age_s
        if isinstance(payload, Fact):
            kind, noted_s = "fact", self.seen.seen_s(payload) or noted_s
            self.seen.forget_first(beyond=_SEEN)  # observed once more before it was sent
        number = self._connection.execute(
            "INSERT INTO outbox (kind, payload, noted_s) VALUES (?, ?, ?)",
            (kind, msgspec.json.encode(payload), noted_s),
        ).lastrowid
        assert number is not None
        self._once_written.append(partial(self._note_waiting, number, payload))

    def _note_waiting(self, number: int, payload: Payload) -> None:
        if isinstance(payload, Report):
            self._reports[number] = name = AttemptName.of(payload)
            self._last_report[name] = number
        elif isinstance(payload, Fact):
            self.seen.wait(number, payload.key)

    def _fence(self, order: Order) -> None:
        self._raise("epoch", highest=order.epoch)
        self._raise("revision", order.planner, order.plan, highest=order.revision)

    def _raise(
        self,
        scope: str,
        planner: str | None = None,
        plan: str = "",
        task: str = "",
        *,
        highest: int,
    ) -> None:
        self._connection.execute(
            "INSERT INTO fence VALUES (?, ?, ?, ?, ?) ON CONFLICT (scope, planner, plan, task) "
            "DO UPDATE SET highest = max(highest, excluded.highest)",
            (scope, planner or "", plan, task, highest),
        )

    def _write(self, attempt: Attempt) -> None:
        order = attempt.order
        self._fence(order)
        self._connection.execute(
            "INSERT INTO attempt "
            '(planner, plan, task, attempt, phase, "order", report, ended_at) '
            "VALUES (?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (planner, plan, task, attempt) "
            'DO UPDATE SET phase=excluded.phase, "order"=excluded."order", '
            "report=excluded.report, ended_at=excluded.ended_at",
            (
                *_row_of(attempt.name),
                attempt.phase.value,
                msgspec.json.encode(order),
                None if attempt.report is None else msgspec.json.encode(attempt.report),
                attempt.ended_wall_s,
            ),
        )
        self._once_written.append(partial(self.ledger.put, attempt))

    def _forget(self, name: AttemptName) -> None:
        """Forget an attempt in memory and on the disk; the ledger says which fences stay."""
        ledger = self.ledger
        order = ledger.attempts[name].order
        ledger.forget(name)
        self._delete(name, Phase.ENDED)
        if order.serial:
            self._raise("serial", name.planner, highest=ledger.forgotten[name.planner])
        else:
            highest = ledger.unnumbered[name.of_task]
            self._raise("attempt", *name.of_task, highest=highest)
        if name.in_plan not in ledger.revisions:
            self._connection.execute(
                "DELETE FROM fence WHERE scope='revision' AND planner=? AND plan=?",
                (name.planner or "", name.plan),
            )

    def _delete(self, name: AttemptName, phase: Phase) -> None:
        row = (*_row_of(name), phase.value)
        self._connection.execute(f"DELETE FROM attempt WHERE {_IS_ATTEMPT} AND phase=?", row)

    def _load(self, db: sqlite3.Connection) -> None:
        read_ledger(db, self.ledger)
        for number, payload, noted_s in read_outbox(db):
            self._note_waiting(number, payload)
            if isinstance(payload, Fact):
                self.seen.note(payload, running_s() - since(noted_s))


def _row_of(name: AttemptName) -> tuple[str, str, str, int]:
    """How an attempt is named in the file."""
    return (name.planner or "", name.plan, name.task, name.attempt)
