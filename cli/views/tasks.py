"""Tasks and their reports as tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.table import Table

from cli.times import moment
from cli.views.console import table
from cli.views.text import last_s, seconds, skill_call, spent_s
from cli.views.waits import why_shown
from keyexpr_schema.payloads.tasks import Report, TaskRecord, Try


def tasks_table(records: Iterable[TaskRecord], now_s: float | None = None) -> Table:
    """One line a task."""
    return table(
        [
            "plan",
            "task",
            "call",
            "robot",
            "state",
            "since",
            "attempt",
            "spent",
            "predicted",
            "after",
            "why",
        ],
        (
            (
                record.plan,
                record.task,
                skill_call(record.skill, record.args, leave_out=record.robot),
                record.robot,
                record.state.value,
                moment(record.wall_time_s, last_s(record)),
                record.attempt or "",
                seconds(spent_s(record, now_s)),
                seconds(record.duration_s) if record.duration_s else "",
                ", ".join(record.after),
                why_shown(record.waits_for, record.reason, record.plan),
            )
            for record in records
        ),
    )


def reports_table(reports: Iterable[Report]) -> Table:
    """One line a try of each attempt at a task; an attempt without tries has one line too."""
    rows: list[Sequence[object]] = []
    for report in reports:
        learned = ", ".join(str(fact.literal) for fact in report.facts)
        state = report.state.value
        for each in report.tries or (report,):
            number = each.number if isinstance(each, Try) else ""
            shown = state if each in (report, *report.tries[-1:]) else "failed"
            spent = _between(each.started_s, each.ended_s)
            rows.append((report.attempt, report.robot, shown, number, spent, each.reason, learned))
    return table(["attempt", "robot", "state", "try", "spent", "reason", "learned"], rows)


def _between(start_s: float | None, end_s: float | None) -> str:
    return seconds(end_s - start_s) if start_s is not None and end_s is not None else ""
