"""The archive: everything that is over, in a SQLite file that no start of the planner reads.

What ended leaves the planner's state at once, so the archive is what remembers that it was: a
request that was answered, a goal that was reached, the name of a plan. It is asked for one of them
at a time, by an index. It also knows which of them still have keys (`live`), and whether the store
has confirmed the last values there (`settled`).
"""

from __future__ import annotations

import sqlite3
import zlib
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import msgspec
from msgspec.structs import replace

from fleet.errors import StoreError
from fleet.history.entries import entry_of
from keyexpr_schema.decoding import decode
from keyexpr_schema.full_disk import FREE_SOME, is_full
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.history import (
    Ended,
    GoalRecord,
    HistoryOutcome,
    PastEntry,
    PastGoal,
    PlanRecord,
    RequestRecord,
)
from keyexpr_schema.private_files import private_database, private_folder

FORMAT = 1
FILE = "archive.db"
PLAN, GOAL, REQUEST = "plan", "goal", "request"
_TABLES = f"""
CREATE TABLE IF NOT EXISTS ended (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    kind TEXT NOT NULL,
    name TEXT NOT NULL,
    ended_wall_s REAL NOT NULL,
    outcome TEXT NOT NULL,
    begun_s REAL NOT NULL,
    ended_s REAL NOT NULL,
    begun_wall_s REAL NOT NULL,
    replans INTEGER NOT NULL,
    live INTEGER NOT NULL,
    settled INTEGER NOT NULL,
    entry BLOB NOT NULL,
    record BLOB NOT NULL,
    UNIQUE (kind, name, ended_wall_s)
);
CREATE INDEX IF NOT EXISTS ended_by_time ON ended (ended_wall_s);
CREATE INDEX IF NOT EXISTS ended_live ON ended (kind, number) WHERE live;
CREATE INDEX IF NOT EXISTS ended_unsettled ON ended (number) WHERE NOT settled;
CREATE TABLE IF NOT EXISTS goals (
    goal TEXT NOT NULL,
    number INTEGER NOT NULL,
    outcome TEXT NOT NULL,
    reason TEXT,
    took_s REAL,
    ended_wall_s REAL NOT NULL,
    live INTEGER NOT NULL,
    spec BLOB NOT NULL,
    PRIMARY KEY (goal, number)
) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS goals_of ON goals (number);
CREATE INDEX IF NOT EXISTS goals_by_time ON goals (ended_wall_s);
CREATE INDEX IF NOT EXISTS goals_live ON goals (ended_wall_s) WHERE live;
CREATE TABLE IF NOT EXISTS robots (
    robot TEXT NOT NULL,
    number INTEGER NOT NULL,
    tasks INTEGER NOT NULL,
    busy_s REAL NOT NULL,
    PRIMARY KEY (robot, number)
) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS robots_of ON robots (number);
PRAGMA user_version = {FORMAT};
"""
_ENDED: msgspec.json.Decoder[Ended] = msgspec.json.Decoder(Ended)


@dataclass(frozen=True)
class Live:
    """Something that is over and still has keys; `goals` are those whose keys go with it."""

    number: int
    kind: str
    name: str
    goals: tuple[str, ...] = ()


class Archive:
    """The archive in `folder`; use in a `with` block.

    Raises:
        StoreError: on entering, if the file cannot be used.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / FILE

    def __enter__(self) -> Archive:
        with ExitStack() as opened:
            try:
                private_folder(self.path.parent)
                self._db = sqlite3.connect(private_database(self.path), isolation_level=None)
                opened.callback(self._db.close)
                version = self._db.execute("PRAGMA user_version").fetchone()[0]
                if version > FORMAT:
                    raise StoreError(
                        f"the archive {self.path} has format {version}, but this program knows "
                        f"formats up to {FORMAT}: update it"
                    )
                self._db.execute("PRAGMA journal_mode=WAL")
                self._db.execute("PRAGMA synchronous=NORMAL")
                self._db.executescript(_TABLES)
            except (sqlite3.Error, OSError) as error:
                what = FREE_SOME if is_full(error) else "move it away to begin with an empty one"
                raise StoreError(
                    f"the archive {self.path} cannot be used ({error}): {what}"
                ) from None
            opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._db.close()

    def sync(self) -> None:
        """Have all that was kept outlive a power cut, too; may be called in any thread."""
        with closing(sqlite3.connect(self.path)) as db:
            db.execute("PRAGMA synchronous=NORMAL")
            db.execute("PRAGMA wal_checkpoint(PASSIVE)")

    @contextmanager
    def reading(self) -> Iterator[sqlite3.Connection]:
        """A connection of its own that only reads, for another thread."""
        with closing(sqlite3.connect(f"{self.path.absolute().as_uri()}?mode=ro", uri=True)) as db:
            yield db

    # --- what ended ------------------------------------------------------------------------------

    def add(self, records: Iterable[Ended]) -> None:
        """Keep what is over, all of it or nothing; what is kept already stays as it is."""
        with self._transaction():
            for record in records:
                self._add(record)

    def _add(self, record: Ended) -> None:
        entry = None if isinstance(record, RequestRecord) else entry_of(record)
        # Whoever deletes a goal deletes its keys.
        live = not (isinstance(record, GoalRecord) and record.deleted)
        added = self._db.execute(
            "INSERT OR IGNORE INTO ended (kind, name, ended_wall_s, outcome, begun_s, ended_s, "
            "begun_wall_s, replans, live, settled, entry, record) "
            "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (
                *_kind_and_name(record),
                record.ended_wall_s,
                "" if entry is None else entry.outcome.value,
                record.ended_s if entry is None else entry.begun_s,
                record.ended_s,
                record.ended_wall_s if entry is None else entry.begun_wall_s,
                0 if entry is None else entry.replans,
                live,
                not live,
                b"" if entry is None else msgspec.json.encode(entry),
                _packed(record),
            ),
        )
        if isinstance(record, RequestRecord) or entry is None or not added.rowcount:
            return
        number = added.lastrowid
        goals = record.goals if isinstance(record, PlanRecord) else (record,)
        for goal, past in zip(goals, entry.goals, strict=True):
            over = past.outcome is not HistoryOutcome.OPEN
            self._db.execute(
                "INSERT OR IGNORE INTO goals VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                (
                    past.goal,
                    number,
                    past.outcome.value,
                    past.reason,
                    past.took_s,
                    goal.ended_wall_s,
                    over and not goal.deleted,
                    msgspec.json.encode(goal.spec),
                ),
            )
        self._db.executemany(
            "INSERT INTO robots VALUES (?, ?, ?, ?)",
            [(share.robot, number, share.tasks, share.busy_s) for share in entry.robots],
        )

    def unsettled(self) -> list[Ended]:
        """What is over and perhaps not yet so on its keys, oldest first."""
        rows = self._db.execute("SELECT record FROM ended WHERE NOT settled ORDER BY number")
        return [_unpacked(data) for (data,) in rows]

    def settle(self, record: Ended) -> None:
        """The store has confirmed the last values of its keys."""
        kept = record
        if isinstance(record, RequestRecord):  # what a dry run would have come to
            answer = replace(record.answer, preview=None, preview_status=None)
            kept = replace(record, answer=answer)
        self._db.execute(
            "UPDATE ended SET settled = 1, record = ? "
            "WHERE kind = ? AND name = ? AND ended_wall_s = ?",
            (_packed(kept), *_kind_and_name(record), record.ended_wall_s),
        )

    # --- what was --------------------------------------------------------------------------------

    def answered(self, request: str) -> bool:
        """Whether a request is over."""
        return self._one("SELECT 1 FROM ended WHERE kind = ? AND name = ?", REQUEST, request)

    def plan(self, plan: str) -> PastEntry | None:
        """What came of the latest plan of this name that is over."""
        row = self._db.execute(
            "SELECT number, entry FROM ended WHERE kind = ? AND name = ? ORDER BY number DESC",
            (PLAN, plan),
        ).fetchone()
        return None if row is None else _entry(*row)

    def goal(self, goal: str) -> Goal | None:
        """A goal that is over and still has keys, as it was wanted."""
        row = self._db.execute(
            "SELECT spec FROM goals WHERE goal = ? AND live ORDER BY number DESC", (goal,)
        ).fetchone()
        return None if row is None else decode(row[0], Goal)

    def past_goal(self, goal: str) -> PastGoal | None:
        """What came of the latest goal of this name that is over."""
        row = self._db.execute(
            "SELECT number, outcome, reason FROM goals WHERE goal = ? AND outcome != ? "
            "ORDER BY number DESC",
            (goal, HistoryOutcome.OPEN.value),
        ).fetchone()
        if row is None:
            return None
        return PastGoal(goal=goal, text="", outcome=HistoryOutcome(row[1]), reason=row[2])

    def _one(self, query: str, *values: object) -> bool:
        return self._db.execute(f"{query} LIMIT 1", values).fetchone() is not None

    # --- its keys --------------------------------------------------------------------------------

    def due(self, kind: str, keep: int, before_wall_s: float, limit: int = 100) -> list[Live]:
        """Of a kind, what has keys and is older than the `keep` newest, or than a Unix time [s]."""
        rows = self._db.execute(
            "SELECT number, name FROM ended WHERE kind = ? AND live AND settled "
            "AND (ended_wall_s < ? OR number <= coalesce((SELECT number FROM ended "
            "WHERE kind = ? AND live ORDER BY number DESC LIMIT 1 OFFSET ?), 0)) "
            "ORDER BY number LIMIT ?",
            (kind, before_wall_s, kind, keep, limit),
        ).fetchall()
        return [Live(number, kind, name, self._live_goals(number)) for number, name in rows]

    def live_plan(self, plan: str) -> Live | None:
        """The keys that a plan which is over still has."""
        row = self._db.execute(
            "SELECT number FROM ended WHERE kind = ? AND name = ? AND live", (PLAN, plan)
        ).fetchone()
        return None if row is None else Live(row[0], PLAN, plan, self._live_goals(row[0]))

    def live_goals(self, before_wall_s: float) -> list[str]:
        """Goals that ended before a Unix time [s] and have keys."""
        rows = self._db.execute(
            "SELECT DISTINCT goal FROM goals WHERE live AND ended_wall_s < ?", (before_wall_s,)
        )
        return [goal for (goal,) in rows]

    def live_goals_like(self, pattern: str) -> list[str]:
        """Goals that are over and have keys, whose names match a pattern of SQLite's GLOB."""
        rows = self._db.execute(
            "SELECT DISTINCT goal FROM goals WHERE goal GLOB ? AND live", (pattern,)
        )
        return [goal for (goal,) in rows]

    def _live_goals(self, number: int) -> tuple[str, ...]:
        rows = self._db.execute("SELECT goal FROM goals WHERE number = ? AND live", (number,))
        return tuple(goal for (goal,) in rows)

    def retire(self, gone: Iterable[Live]) -> None:
        """Their keys are deleted."""
        with self._transaction():
            for live in gone:
                self._db.execute("UPDATE ended SET live = 0 WHERE number = ?", (live.number,))
                self._db.execute("UPDATE goals SET live = 0 WHERE number = ?", (live.number,))

    def retire_goal(self, goal: str) -> None:
        """The keys of a goal are deleted, or are those of a new goal of that name."""
        with self._transaction():
            self._db.execute(
                "UPDATE ended SET live = 0, settled = 1 WHERE kind = ? AND name = ?", (GOAL, goal)
            )
            self._db.execute("UPDATE goals SET live = 0 WHERE goal = ?", (goal,))

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._db.execute("COMMIT")
        except BaseException:
            if self._db.in_transaction:  # for want of room, SQLite has taken it back by itself
                self._db.execute("ROLLBACK")
            raise


def _kind_and_name(record: Ended) -> tuple[str, str]:
    match record:
        case PlanRecord():
            return PLAN, record.spec.plan
        case GoalRecord():
            return GOAL, record.spec.goal
        case RequestRecord():
            return REQUEST, record.answer.request


def _packed(record: Ended) -> bytes:
    return zlib.compress(msgspec.json.encode(record))


def _unpacked(data: bytes) -> Ended:
    return _ENDED.decode(zlib.decompress(data))


def _entry(number: int, data: bytes) -> PastEntry:
    return replace(decode(data, PastEntry), number=number)
