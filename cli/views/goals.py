"""Goals as a table, and one on a page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from textwrap import shorten

import msgspec
from rich.console import Group
from rich.table import Table
from rich.text import Text

from cli.times import moment
from cli.views.console import table
from cli.views.text import STATE_STYLE, meaning, stages
from cli.views.waits import waits_shown, why_shown
from fleet.core.model.recurrence import when_shown
from fleet.service.time_zones import zones_of
from keyexpr_schema.payloads.goals import ENDED_GOALS, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.waits import WaitKind

LONGEST = 200
"""Characters of what a goal was understood as that a table shows; `goal show` has all of it."""


class GoalRow(msgspec.Struct, frozen=True, kw_only=True):
    """One goal as `robotctl goal list --json` shows it."""

    goal: str
    spec: Goal | None
    status: GoalStatus | None
    parts: tuple[GoalStatus, ...] = ()
    """Goals that it has made, and that have not ended."""


def goal_row(goal: str, goals: Mapping[str, Goal], status: Mapping[str, GoalStatus]) -> GoalRow:
    """One goal, with how it stands."""
    known = status.get(goal)
    parts = tuple(status[part] for part in (known.parts if known else ()) if part in status)
    return GoalRow(goal=goal, spec=goals.get(goal), status=known, parts=parts)


def goal_rows(goals: Mapping[str, Goal], status: Mapping[str, GoalStatus]) -> list[GoalRow]:
    """Every goal in the order it was given, what goes on of schedules that were deleted, and what
    the planner wants itself."""
    rows = [goal_row(goal, goals, status) for goal in goals]
    rows += [
        goal_row(name, goals, status)
        for name, each in status.items()
        if each.own
        or (
            each.part_of is not None
            and each.state not in ENDED_GOALS
            and each.part_of not in goals
            and each.part_of not in status
        )
    ]
    return sorted(rows, key=lambda row: (row.spec.ordinal if row.spec else 0, row.goal))


def _text(row: GoalRow) -> str:
    if row.spec is not None:
        return row.spec.text
    own = row.status if row.status is not None and row.status.own else None
    return (own.understood or "") if own is not None else ""


def goals_table(rows: Iterable[GoalRow]) -> Table:
    """One line a goal."""
    return table(
        ["goal", "state", "since", "priority", "text", "means", "plan", "why"],
        (
            (
                row.goal,
                (row.status.state if row.status else GoalState.WAITING).value,
                moment(row.status.wall_time_s, row.status.time_s) if row.status else "",
                row.spec.priority if row.spec else "",
                _text(row),
                shorten(meaning(row.status), LONGEST, placeholder=" …") if row.status else "",
                row.status.plan if row.status else "",
                why_shown(row.status.waits_for, row.status.reason) if row.status else "",
            )
            for each in rows
            for row in (each, *(GoalRow(goal=p.goal, spec=None, status=p) for p in each.parts))
        ),
    )


def goal_sentence(spec: Goal, status: GoalStatus, planned: bool = True) -> str:
    """How a goal stands and what it was understood as; how to have it planned, if it is not."""
    means = meaning(status)
    said = f", said by a language model as “{status.paraphrase}”" if status.paraphrase else ""
    words = f" ({status.understood})" if status.understood not in (None, means) else ""
    understood = f"{said}, understood as {means}{words}" if means else ""
    hint = ""
    if status.state is GoalState.WAITING and not planned:
        plans = [why.plan for why in status.waits_for if why.kind is WaitKind.PLAN]
        unasked = any(why.kind is WaitKind.NO_PLAN for why in status.waits_for)
        if plans:
            hint = f"; plan {plans[0]} is being made for it"
        elif unasked or not status.waits_for:
            hint = f"; plan it with `robotctl plan create big-dag makespan {spec.goal}`"
        elif status.reason:
            hint = f": {status.reason}"
    if status.state in (GoalState.PENDING, GoalState.STANDING, GoalState.NOT_NEEDED):
        hint = f": {status.reason}" if status.reason else ""
    if status.state is GoalState.STANDING and status.next_s is not None:
        hint += f"; the next is begun at {when_shown(spec, status.next_s, zones_of(spec))}"
    note = f" ({status.note})" if status.note else ""
    return f"goal {spec.goal} is {status.state.value}{understood}{note}{hint}"


def goal_page(row: GoalRow) -> Group:
    """Its words, what they were understood as, where it stands and why."""
    status = row.status
    state = (status.state if status else GoalState.WAITING).value
    lines = [Text.assemble((row.goal, "bold"), "  ", (state, STATE_STYLE.get(state, "")))]
    if row.spec is not None:
        lines.append(Text(f"wanted      “{row.spec.text}”"))
        if row.spec.speaker is not None:
            lines.append(Text(f"said by     {row.spec.speaker}"))
        if row.spec.said_by:
            lines.append(Text(f"put by      {row.spec.said_by}"))
        lines.append(Text(f"priority    {row.spec.priority}"))
        if row.spec.meant is not None:
            lines.append(Text(f"meant       {row.spec.meant}"))
        kept = (("always", row.spec.always), ("never", row.spec.never))
        lines += [Text(f"{word:<12}{each}") for word, all_ in kept for each in all_]
        for each in row.spec.sometime_before:
            done = "  (it has)" if status and each.first in status.passed else ""
            lines.append(Text(f"in order    {each}{done}"))
        if row.spec.by:
            lines.append(Text(f"by          {' or '.join(row.spec.by)}"))
        rows = (("whenever", row.spec.whenever), ("when", row.spec.when), ("if", row.spec.only_if))
        lines += [Text(f"{word:<12}{each}") for word, all_ in rows for each in all_]
        for word, at_s in (("not before", row.spec.not_before_s), ("due", row.spec.due_s)):
            if at_s is not None:
                lines.append(Text(f"{word:<12}{when_shown(row.spec, at_s, zones_of(row.spec))}"))
        if row.spec.every is not None:
            lines.append(Text(f"every       {row.spec.every}"))
    if status is None:
        lines.append(Text("understood  nobody has read it yet: no planner runs", "dim"))
        return Group(*lines)
    if status.understood:
        lines.append(Text(f"in words    {status.understood}"))
    found = stages(status)
    for number, stage in enumerate(found):
        head = "understood  " if number == 0 else "then        "
        now = "  ← now" if len(found) > 1 and number == status.stage else ""
        lines.append(Text(f"{head}{' and '.join(str(each) for each in stage)}{now}"))
    if status.paraphrase is not None:
        lines.append(Text(f"said as     “{status.paraphrase}” by a language model, as the grammar"))
        lines.append(Text(f"            refuses it: {status.refusal}"))
    if status.teaches is not None:
        lines.append(Text(f"teaches     (`robotctl task keep {row.goal} FILE`)"))
        lines.append(Text(status.teaches.rstrip()))
    lines += [
        Text(f"{'can mean' if number == 1 else '':<12}{number}  {words}")
        for number, words in enumerate(status.candidates, 1)
    ]
    if status.plan:
        lines.append(Text(f"plan        {status.plan}"))
    if status.next_s is not None and row.spec is not None:
        lines.append(Text(f"next        {when_shown(row.spec, status.next_s, zones_of(row.spec))}"))
    for number, part in enumerate(row.parts):
        head = "" if number else "parts"
        said = f": {part.reason}" if part.reason else ""
        lines.append(Text(f"{head:<12}{part.goal} {part.state.value}, {meaning(part)}{said}"))
    if status.note:
        lines.append(Text(f"note        {status.note}"))
    if status.reason:
        style = "red" if status.state in ENDED_GOALS else ""
        lines.append(Text(f"reason      {status.reason}", style))
    if waits := waits_shown(status.waits_for):
        lines.append(Text(f"waits for   {waits} (`robotctl why {row.goal}`)"))
    if status.given_wall_s is not None:
        lines.append(Text(f"given       {moment(status.given_wall_s, status.given_s)}"))
    lines.append(Text(f"since       {moment(status.wall_time_s, status.time_s)}"))
    return Group(*lines)
