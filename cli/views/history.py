"""What is over as a table, and what it comes to."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from msgspec.structs import replace
from rich.console import Group, RenderableType
from rich.table import Table

from cli.times import moment
from cli.views.console import table
from cli.views.text import seconds
from keyexpr_schema.payloads.audit import AuditPage
from keyexpr_schema.payloads.history import (
    HistoryOutcome,
    HistoryStats,
    PastEntry,
    PastGoal,
    PeriodStats,
    Retired,
)


def history_table(entries: Iterable[PastEntry]) -> Table:
    """One line a goal, with what is about its whole plan on the first one; goals that were deleted
    stand with the plan that worked on them."""
    rows: list[Sequence[object]] = []
    for entry in joined(entries):
        goals: Sequence[PastGoal | None] = entry.goals or (None,)
        for number, goal in enumerate(goals):
            rows.append(
                (
                    *(
                        (
                            moment(entry.ended_wall_s, entry.ended_s),
                            entry.plan or (goal.plan if goal else None),
                        )
                        if number == 0
                        else ("", "")
                    ),
                    (goal.text or goal.goal) + (f" ({goal.by})" if goal.by else "") if goal else "",
                    (goal.outcome if goal else entry.outcome).value,
                    seconds(goal.took_s if goal else max(0.0, entry.ended_s - entry.begun_s)),
                    *(_work(entry) if number == 0 else ("", "", "")),
                    (goal.reason if goal else entry.reason) or (entry.reason if not number else ""),
                )
            )
    columns = ["ended", "plan", "wanted", "came of it", "took", "who did it", "tasks", "replans"]
    return table([*columns, "reason"], rows)


def joined(entries: Iterable[PastEntry]) -> list[PastEntry]:
    """These entries, newest first, with each goal that was deleted among those of the plan that
    worked on it then, where that is one of them: the plan itself knows no more of it."""
    listed, found = list(entries), list[PastEntry]()
    alone: dict[str, list[PastEntry]] = {}
    told: set[int] = set()
    for entry in reversed(listed):
        if entry.plan is not None:  # the next of its name to end
            deleted = alone.pop(entry.plan, [])
            told.update(each.number for each in deleted)
            goals = (*entry.goals, *(goal for each in deleted for goal in each.goals))
            entry = replace(entry, goals=goals) if deleted else entry
        for goal in entry.goals if entry.plan is None else ():
            if goal.outcome is HistoryOutcome.DELETED and goal.plan is not None:
                alone.setdefault(goal.plan, []).append(entry)
        found.append(entry)
    return [entry for entry in reversed(found) if entry.number not in told]


def _work(entry: PastEntry) -> tuple[object, object, object]:
    who = ", ".join(f"{share.robot} {seconds(share.busy_s)}" for share in entry.robots)
    return who, entry.tasks or "", entry.replans or ""


def audit_table(page: AuditPage) -> Table:
    """One line a deed."""
    rows = [
        (moment(e.wall_time_s, e.time_s), e.by or "(not said)", e.summary) for e in page.entries
    ]
    if page.more:
        rows.append(("…", "", "there is more: --last N, --since TIME"))
    return table(["when", "who", "what"], rows)


def stats_page(stats: HistoryStats) -> RenderableType:
    """Goals by day, robots, and why goals were not reached."""
    total = stats.total
    if not total.goals and not total.plans:
        return "Nothing is over yet."
    parts: list[RenderableType] = [_periods([*stats.days, total])]
    if total.robots:
        rows = [
            (use.robot, use.tasks, seconds(use.busy_s), f"{use.utilisation:.0%}")
            for use in total.robots
        ]
        parts += ["", table(["robot", "tasks", "busy", "utilisation"], rows)]
    if total.failures:
        rows_of_reasons = [(each.goals, each.reason) for each in total.failures]
        parts += ["", table(["goals", "not reached, because"], rows_of_reasons)]
    return Group(*parts)


def _periods(periods: Iterable[PeriodStats]) -> Table:
    outcomes = (
        HistoryOutcome.REACHED,
        HistoryOutcome.FAILED,
        HistoryOutcome.REJECTED,
        HistoryOutcome.DELETED,
    )
    rows = [
        (
            period.day or "in all",
            *(period.goals.get(outcome, 0) for outcome in outcomes),
            seconds(period.median_s),
            seconds(period.p90_s),
            sum(period.plans.values()),
            period.replans,
            seconds(period.active_s),
        )
        for period in periods
    ]
    columns = ["day", *(outcome.value for outcome in outcomes), "time to goal: median", "p90"]
    return table([*columns, "plans", "replans", "plans under way"], rows)


def retired_sentence(gone: Retired) -> str:
    """What was deleted, and where it still is."""
    counts = [(gone.plans, "plan"), (gone.goals, "goal")]
    said = [f"{count} {what}{'' if count == 1 else 's'}" for count, what in counts if count]
    if not said:
        return "there is nothing such that has ended"
    them = "it" if gone.plans + gone.goals == 1 else "them"
    return f"deleted {' and '.join(said)}; `robotctl history` still has {them}"
