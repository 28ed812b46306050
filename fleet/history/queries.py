"""What is asked of the archive: its entries, page by page, and what they come to."""

from __future__ import annotations

import math
import sqlite3
import statistics
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime, timedelta, timezone

from msgspec.structs import replace

from keyexpr_schema.decoding import decode
from keyexpr_schema.payloads.history import (
    FailureCount,
    HistoryOutcome,
    HistoryPage,
    HistoryQuery,
    HistoryStats,
    HistoryStatsQuery,
    PastEntry,
    PeriodStats,
    RobotUse,
)

MOST_ENTRIES = 1000
"""Of one page."""
_OF_GOAL = (
    "SELECT number FROM goals WHERE goal = ? "
    # and what it has made: `g.1`, `g.2`; a slash comes next after a dot
    "OR (goal > ? || '.' AND goal < ? || '/' AND goal GLOB '*.[0-9]*')"
)
MOST_REASONS = 20
"""Of a period, the most frequent ones."""


def page(db: sqlite3.Connection, query: HistoryQuery) -> HistoryPage:
    """The entries that are asked for, newest first."""
    limit = max(1, min(query.limit, MOST_ENTRIES))
    conditions, values = ["kind != 'request'"], list[object]()
    if query.goal is not None:
        plans = _plans_taken_from(db, query.goal)
        marks = ", ".join("?" * len(plans))
        of_plans = f"SELECT number FROM ended WHERE kind = 'plan' AND name IN ({marks})"
        conditions.append(f"number IN ({_OF_GOAL} UNION ALL {of_plans})")
        values += [query.goal] * _OF_GOAL.count("?") + plans
    for condition, value in (
        ("number < ?", query.before),
        ("ended_wall_s >= ?", query.since_wall_s),
        ("number IN (SELECT number FROM robots WHERE robot = ?)", query.robot),
    ):
        if value is not None:
            conditions.append(condition)
            values += [value] * condition.count("?")
    rows = db.execute(
        f"SELECT number, entry FROM ended WHERE {' AND '.join(conditions)} "
        "ORDER BY number DESC LIMIT ?",
        (*values, limit + 1),
    ).fetchall()
    entries = tuple(
        replace(decode(data, PastEntry), number=number) for number, data in rows[:limit]
    )
    return HistoryPage(entries=entries, before=entries[-1].number if len(rows) > limit else None)


def _plans_taken_from(db: sqlite3.Connection, goal: str) -> list[str]:
    """The plans that worked on a goal, or on what it has made, when that was deleted: they know no
    more of it."""
    rows = db.execute(
        # The plus has it look for the few numbers, and not for all that is a goal.
        f"SELECT entry FROM ended WHERE +kind = 'goal' AND outcome = ? AND number IN ({_OF_GOAL}) "
        "ORDER BY number DESC LIMIT ?",
        (HistoryOutcome.DELETED.value, *[goal] * _OF_GOAL.count("?"), MOST_ENTRIES),
    )
    past = (each for (data,) in rows for each in decode(data, PastEntry).goals)
    return list(dict.fromkeys(each.plan for each in past if each.plan is not None))


def stats(db: sqlite3.Connection, query: HistoryStatsQuery) -> HistoryStats:
    """What the history comes to, as a whole and by day."""
    zone = timezone(timedelta(seconds=query.utc_offset_s))
    since_s = 0.0 if query.since_wall_s is None else query.since_wall_s
    total, days = _Period(), dict[str, _Period]()

    def periods(wall_s: float) -> tuple[_Period, _Period]:
        day = datetime.fromtimestamp(wall_s, zone).date().isoformat()
        return total, days.setdefault(day, _Period())

    for wall_s, outcome, reason, took_s in db.execute(
        "SELECT ended_wall_s, outcome, reason, took_s FROM goals "
        "WHERE ended_wall_s >= ? AND outcome != 'open' ORDER BY ended_wall_s",
        (since_s,),
    ):
        for period in periods(wall_s):
            period.count_goal(HistoryOutcome(outcome), reason, took_s)
    for wall_s, outcome, replans, begun_s, ended_s in db.execute(
        "SELECT ended_wall_s, outcome, replans, begun_s, ended_s FROM ended "
        "WHERE kind = 'plan' AND ended_wall_s >= ? ORDER BY begun_wall_s",
        (since_s,),
    ):
        for period in periods(wall_s):
            period.count_plan(HistoryOutcome(outcome), replans, begun_s, ended_s)
    for wall_s, robot, tasks, busy_s in db.execute(
        "SELECT ended.ended_wall_s, robot, tasks, busy_s FROM robots "
        "JOIN ended USING (number) WHERE ended.ended_wall_s >= ?",
        (since_s,),
    ):
        for period in periods(wall_s):
            period.count_work(robot, tasks, busy_s)
    return HistoryStats(
        total=total.added_up(),
        days=tuple(period.added_up(day) for day, period in sorted(days.items())),
    )


@dataclass
class _Period:
    goals: Counter[HistoryOutcome] = field(default_factory=Counter)
    plans: Counter[HistoryOutcome] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    took_s: list[float] = field(default_factory=list)
    replans: int = 0
    spans_s: list[tuple[float, float]] = field(default_factory=list)
    tasks: Counter[str] = field(default_factory=Counter)
    busy_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))

    def count_goal(self, outcome: HistoryOutcome, reason: str | None, took_s: float | None) -> None:
        self.goals[outcome] += 1
        if outcome is HistoryOutcome.REACHED and took_s is not None:
            self.took_s.append(took_s)
        if outcome in (HistoryOutcome.FAILED, HistoryOutcome.REJECTED):
            self.reasons[reason or "no reason given"] += 1

    def count_plan(
        self, outcome: HistoryOutcome, replans: int, begun_s: float, ended_s: float
    ) -> None:
        self.plans[outcome] += 1
        self.replans += replans
        self.spans_s.append((begun_s, ended_s))

    def count_work(self, robot: str, tasks: int, busy_s: float) -> None:
        self.tasks[robot] += tasks
        self.busy_s[robot] += busy_s

    def added_up(self, day: str | None = None) -> PeriodStats:
        active_s = covered_s(self.spans_s)
        return PeriodStats(
            day=day,
            goals=dict(self.goals),
            plans=dict(self.plans),
            failures=tuple(
                FailureCount(reason=reason, goals=count)
                for reason, count in self.reasons.most_common(MOST_REASONS)
            ),
            median_s=statistics.median(self.took_s) if self.took_s else None,
            p90_s=percentile(self.took_s, 0.9),
            replans=self.replans,
            active_s=active_s,
            robots=tuple(
                RobotUse(
                    robot=robot,
                    tasks=self.tasks[robot],
                    busy_s=busy_s,
                    utilisation=min(1.0, busy_s / active_s) if active_s > 0.0 else 0.0,
                )
                for robot, busy_s in sorted(self.busy_s.items())
            ),
        )


def percentile(values: Iterable[float], share: float) -> float | None:
    """The smallest value that this share of the values does not exceed (nearest rank)."""
    ordered = sorted(values)
    if not ordered:
        return None
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)]


def covered_s(spans_s: Iterable[tuple[float, float]]) -> float:
    """How much time spans on the fleet's clock cover together, s, in the order they began.

    One that begins before the latest beginning belongs to a clock that was set back.
    """
    total_s, latest_s, until_s = 0.0, 0.0, 0.0
    for begun_s, ended_s in spans_s:
        if begun_s < latest_s:
            until_s = begun_s
        latest_s = begun_s
        total_s += max(0.0, ended_s - max(begun_s, until_s))
        until_s = max(until_s, ended_s)
    return total_s
