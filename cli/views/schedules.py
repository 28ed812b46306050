"""Schedules and goals for later: as a table, one on a page, and in a line of `status`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import datetime

from rich.console import Group
from rich.table import Table
from rich.text import Text

from cli.client.schedules import RunTime, ScheduleRow
from cli.views.console import table
from cli.views.text import STATE_STYLE, meaning
from fleet.language.words.recurring import times_in_words
from fleet.service.time_zones import host_zone
from keyexpr_schema.payloads.goals import GoalStatus
from keyexpr_schema.payloads.schedules import Missed, Overlap, ScheduleState, ScheduleStatus

STYLE = {"active": "green", "paused": "yellow", "rejected": "red", "over": "dim"}
_MOST = 5
"""So many runs `status` shows."""


def clock_shown(iso: str | None) -> str:
    """`Mon 2026-11-30 08:00`, as clocks show it there."""
    if iso is None:
        return ""
    at = datetime.fromisoformat(iso)
    return f"{at:%a %Y-%m-%d %H:%M}{f':{at:%S}' if at.second else ''}"


def times_shown(row: ScheduleRow) -> str:
    """When it is done: a line of cron, a period, what it stands by or waits for."""
    if row.status is not None:
        return row.status.every or ""
    if row.kind == "whenever" and row.goal_status is not None:
        return f"whenever {' and '.join(map(str, row.goal_status.whenever))}"
    return row.kind


def schedules_table(rows: Iterable[ScheduleRow]) -> Table:
    """One line each; the time zone stands beside the times where it is not this host's."""
    here = host_zone()
    return table(
        ["schedule", "state", "times", "next", "last", "runs", "what", "reason"],
        (
            (
                row.schedule,
                row.state,
                f"{times_shown(row)}{_elsewhere(row.status, here)}",
                clock_shown(row.next),
                clock_shown(row.status.last) if row.status else "",
                row.goal_status.runs if row.goal_status and row.kind != "once" else "",
                row.text or (meaning(row.goal_status) if row.goal_status else ""),
                row.goal_status.reason if row.goal_status else row.status and row.status.reason,
            )
            for row in rows
        ),
    )


def _elsewhere(status: ScheduleStatus | None, here: str | None) -> str:
    zone = status.zone if status is not None else None
    return f" {zone}" if zone not in (None, here) else ""


def schedule_page(row: ScheduleRow) -> Group:
    """What is wanted when, what comes next, and what became of the runs before."""
    head = Text.assemble((row.schedule, "bold"), "  ", (row.state, STYLE.get(row.state, "")))
    lines = [head, Text(f"wanted      “{row.text}”")]
    goal, status = row.goal_status, row.status
    if status is not None:
        words = f"  ({times_in_words(status.every)})" if status.every else ""
        lines.append(Text(f"times       {status.every or 'not known'}{words}"))
        lines.append(Text(f"zone        {status.zone or 'none: the offset when it was said'}"))
        if status.understood:
            lines.append(Text(f"in words    {status.understood}"))
    else:
        lines.append(Text(f"times       {times_shown(row)}"))
    if row.kind == "every":
        missed, overlap = (
            (row.spec.missed, row.spec.overlap) if row.spec else (Missed.ONCE, Overlap.SKIP)
        )
        lines.append(Text(f"missed      {missed.value}"))
        lines.append(Text(f"overlap     {overlap.value}"))
    put = row.goal if row.spec is None else row.spec.goal
    if put is not None and put.said_by:
        lines.append(Text(f"put by      {put.said_by}"))
    if row.next is not None and goal is not None and goal.next_s is not None:
        shown = f"{clock_shown(row.next)}{_mission_s(row.next, goal.next_s)}"
        lines.append(Text(f"next        {shown}"))
    if status is not None and status.last is not None and status.last_s is not None:
        shown = f"{clock_shown(status.last)}{_mission_s(status.last, status.last_s)}"
        lines.append(Text(f"last        {shown}, {status.latest}"))
    if goal is not None and row.kind != "once":
        lines.append(Text(f"runs        {goal.runs}{_left_out(status)}"))
        lines += [_run_line(run) for run in row.latest]
    if status is not None and status.queued:
        lines.append(Text(f"waiting     {', '.join(map(clock_shown, status.queued))}"))
    reason = goal.reason if goal is not None else status.reason if status is not None else None
    if reason:
        lines.append(Text(f"reason      {reason}", "red" if row.state == "rejected" else ""))
    return Group(*lines)


def _run_line(run: GoalStatus) -> Text:
    at = "" if run.given_wall_s is None else f" {datetime.fromtimestamp(run.given_wall_s):%a %H:%M}"
    why = f": {run.reason}" if run.reason else f" ({run.note})" if run.note else ""
    state = run.state.value
    return Text.assemble(f"            {run.goal}{at} ", (state, STATE_STYLE.get(state, "")), why)


def runs_table(runs: Sequence[RunTime]) -> Table:
    """One line a run; beside what clocks show the fleet's clock, where that is a simulation's."""
    rows = [
        (run.schedule, clock_shown(run.at) or f"{run.at_s:.0f} s", _mission_s(run.at, run.at_s))
        for run in runs
    ]
    return table(["schedule", "begins", ""], rows)


def next_lines(schedules: Iterable[ScheduleStatus]) -> list[Text]:
    """The next runs of schedules, and which ones are paused or cannot be run, for `status`."""
    listed = sorted(schedules, key=lambda each: (each.next_s is None, each.next_s, each.schedule))
    lines = []
    for each in listed[:_MOST]:
        paused = each.state is ScheduleState.PAUSED
        when = "" if paused else clock_shown(each.next) or each.reason or "no more times"
        said = each.state.value if each.state is not ScheduleState.ACTIVE else "next"
        style = "" if said == "next" else STYLE.get(each.state.value, "")
        lines.append(Text(f"schedule {each.schedule}: {said} {when}".rstrip(), style))
    if (left := len(listed) - _MOST) > 0:
        lines.append(Text(f"{left} more schedules: `robotctl schedule list`"))
    return lines


def _left_out(status: ScheduleStatus | None) -> str:
    if status is None:
        return ""
    counted = (("missed", status.missed), ("left out, as the run before went on", status.skipped))
    said = [f"{count} {what}" for what, count in counted if count]
    return f" ({', '.join(said)})" if said else ""


def _mission_s(iso: str | None, at_s: float) -> str:
    """The time on the fleet's clock beside what clocks show, where that is a simulation's."""
    same = iso is None or abs(datetime.fromisoformat(iso).timestamp() - at_s) < 60.0
    return "" if same else f" ({at_s:.0f} s on the fleet's clock)"
