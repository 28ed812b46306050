"""Fences that somebody has raised beyond what any planner counts to, put back by a person.

Whoever may order can order with an epoch that no planner comes to: the robot refuses all others
from then on, for that is what fences are for. An attempt or a revision that nobody counts to does
the same to a task or a plan, and a serial, once its attempt was forgotten, to all that a planner
orders. So a person can have its journal forget what came with such epochs, or one such attempt, or
how far serials had come, while its worker does not run.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from keyexpr_schema.decoding import decode
from keyexpr_schema.payloads.tasks import Order
from workers.errors import JournalUnreadable
from workers.orders.journal_file import VERSION, connected, trouble_of


@dataclass(frozen=True)
class Fences:
    """The highest planner epoch that a journal has seen, and those of the attempts that it keeps.

    `forgotten` counts the attempts that were dropped just now; `names` are those that are kept, as
    `PLAN/TASK/ATTEMPT`, with the plan's revision. `serials`: up to which one of each planner's
    lineage the attempts are forgotten that were over.
    """

    epoch: int
    attempts: tuple[int, ...]
    forgotten: int = 0
    names: tuple[tuple[str, int], ...] = ()
    serials: tuple[tuple[str, int], ...] = ()


def fences(path: Path, below: int | None = None) -> Fences:
    """What fences the robot whose journal is in `path`; with `below` as it is after forgetting.

    Forgotten are the attempts that were ordered with that epoch or a higher one. The epoch goes
    back to the highest that is left, and so do revisions, and the serials of lineages of which an
    attempt is left.

    Raises:
        JournalBusy: its worker runs.
        JournalUnreadable: there is none, or it cannot be read.
    """
    with _opened(path) as db:
        return _fences(db) if below is None else _forget(db, below)


def forget_attempt(path: Path, plan: str, task: str, attempt: int) -> Fences:
    """What fences the robot once it has forgotten one attempt, of whatever planner, and no other.

    The revision of its plan goes back to the highest that is left; epochs and serials stay.

    Raises:
        JournalBusy, JournalUnreadable: as `fences`.
    """
    with _opened(path) as db:
        named = (plan, task, attempt)
        forged = db.execute("DELETE FROM attempt WHERE (plan, task, attempt) = (?, ?, ?)", named)
        fenced = db.execute(
            "DELETE FROM fence WHERE scope = 'attempt' AND (plan, task, highest) = (?, ?, ?)", named
        )
        db.execute("DELETE FROM call WHERE (plan, task, attempt) = (?, ?, ?)", named)
        if forged.rowcount:
            db.execute("DELETE FROM fence WHERE scope = 'revision' AND plan = ?", (plan,))
            _fence_revisions(db, (each for _, each in _orders(db) if each.plan == plan))
        return replace(_fences(db), forgotten=forged.rowcount + fenced.rowcount)


def reset_serial(path: Path, planner: str, serial: int) -> Fences:
    """What fences the robot once it takes attempts of a planner's lineage again that have a higher
    serial than that; `forgotten` is 1 if it refused some.

    Raises:
        JournalBusy, JournalUnreadable: as `fences`.
    """
    with _opened(path) as db:
        fenced = db.execute(
            "UPDATE fence SET highest = ? WHERE scope = 'serial' AND planner = ? AND highest > ?",
            (serial, planner, serial),
        )
        return replace(_fences(db), forgotten=fenced.rowcount)


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """The journal of a worker that does not run, in one transaction."""
    if not path.is_file():
        raise JournalUnreadable(f"there is no journal in {path}: --data says where it is")
    try:
        with closing(connected(path)) as db:
            db.execute("BEGIN EXCLUSIVE")
            (version,) = db.execute("PRAGMA user_version").fetchone()
            if version != VERSION:
                raise JournalUnreadable(f"{path} is not a journal of version {VERSION}")
            yield db
            db.execute("COMMIT")
    except sqlite3.Error as error:
        raise trouble_of(path, error) from None


def _orders(db: sqlite3.Connection) -> list[tuple[int, Order]]:
    return [
        (number, decode(order, Order))
        for number, order in db.execute('SELECT number, "order" FROM attempt')
    ]


def _fences(db: sqlite3.Connection) -> Fences:
    orders = [order for _, order in _orders(db)]
    kept = tuple(order.epoch for order in orders)
    names = tuple((f"{each.plan}/{each.task}/{each.attempt}", each.revision) for each in orders)
    (highest,) = db.execute("SELECT max(highest) FROM fence WHERE scope = 'epoch'").fetchone()
    serials = db.execute("SELECT planner, highest FROM fence WHERE scope = 'serial' ORDER BY 1")
    return Fences(
        max((highest or 0, *kept)),
        tuple(sorted(set(kept))),
        names=names,
        serials=tuple(serials.fetchall()),
    )


def _forget(db: sqlite3.Connection, below: int) -> Fences:
    forged = [number for number, order in _orders(db) if order.epoch >= below]
    db.executemany("DELETE FROM attempt WHERE number = ?", ((number,) for number in forged))
    left = [order for _, order in _orders(db)]
    db.execute("DELETE FROM fence WHERE scope IN ('epoch', 'revision')")
    highest = max((order.epoch for order in left), default=0)
    db.execute("INSERT INTO fence VALUES ('epoch', '', '', '', ?)", (highest,))
    _fence_revisions(db, left)
    serials: dict[str, int] = {}
    for order in left:
        lineage = order.planner or ""
        serials[lineage] = max(serials.get(lineage, 0), order.serial)
    for lineage, serial in serials.items():
        db.execute(
            "UPDATE fence SET highest = min(highest, ?) WHERE scope = 'serial' AND planner = ?",
            (serial, lineage),
        )
    return replace(_fences(db), forgotten=len(forged))


def _fence_revisions(db: sqlite3.Connection, left: Iterable[Order]) -> None:
    for order in left:
        db.execute(
            "INSERT INTO fence VALUES ('revision', ?, ?, '', ?) ON CONFLICT DO UPDATE "
            "SET highest = max(highest, excluded.highest)",
            (order.planner or "", order.plan, order.revision),
        )
