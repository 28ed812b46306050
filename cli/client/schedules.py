"""Schedules, and other goals for later, as a person speaks of them: listed, paused, deleted."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import datetime
from itertools import islice
from typing import TYPE_CHECKING

import msgspec

from cli.client.fleet_view import FleetView, fleet_view
from cli.client.history import check_not_deleted
from cli.client.holds import end_holds
from cli.client.planner_requests import check_planner
from cli.errors import BadArgument, check_known
from fleet.core.model.recurrence import Recurrence, clock_at
from fleet.core.model.time_zones import moved
from fleet.service.time_zones import UnknownZone, zone_named, zones_of
from keyexpr_schema.keyspace import (
    GOAL_SPEC,
    GOAL_STATUS,
    HOLD,
    SCHEDULE_SPEC,
    SCHEDULE_STATUS,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress, GoalState, GoalStatus
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.schedules import Schedule, ScheduleAddress, ScheduleStatus

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session

KEYS = (SCHEDULE_SPEC, SCHEDULE_STATUS, GOAL_SPEC, GOAL_STATUS, HOLD)
HOW_TO_ADD = "make one with `robotctl goal add TEXT --every TIMES`"
LATEST = 5
"""So many runs are told with a schedule."""
DONE_S = 10.0
"""How long the planner may take to hear of what was deleted."""


class ScheduleRow(msgspec.Struct, frozen=True, kw_only=True):
    """One schedule, or one goal for later, as `robotctl schedule list --json` shows it.

    `kind` is `every` for a schedule, `whenever` for a goal that stands by, `once` for one that is
    begun when its time has come or what it waits for holds. `next` is in ISO 8601.
    """

    schedule: str
    kind: str
    state: str
    text: str
    next: str | None
    spec: Schedule | None
    status: ScheduleStatus | None
    goal: Goal | None
    goal_status: GoalStatus | None
    holds: tuple[Hold, ...] = ()
    latest: tuple[GoalStatus, ...] = ()
    """Its runs of which there are keys, the latest first; `robotctl history` has all."""


class RunTime(msgspec.Struct, frozen=True, kw_only=True):
    """When a run begins: as clocks show it (ISO 8601), and on the fleet's clock [s]."""

    schedule: str
    at: str | None
    at_s: float


def schedule_rows(view: FleetView) -> list[ScheduleRow]:
    """Every schedule and every goal for later; those that come next are first."""
    names = dict.fromkeys([*view.schedules, *view.schedule_status, *view.goal_status])
    rows = [row for name in names if (row := _row(view, name)) is not None]

    def order(row: ScheduleRow) -> tuple[bool, float, str]:
        next_s = row.goal_status.next_s if row.goal_status is not None else None
        return next_s is None, next_s or 0.0, row.schedule

    return sorted(rows, key=order)


def chosen(rows: Iterable[ScheduleRow], names: Sequence[str]) -> list[ScheduleRow]:
    """The rows of these names, in their order.

    Raises:
        Unknown: there is none of that name; the message lists those there are.
    """
    known = {row.schedule: row for row in rows}
    for name in names:
        check_known("schedule or goal for later", name, known, HOW_TO_ADD)
    return [known[name] for name in dict.fromkeys(names)]


def _row(view: FleetView, name: str) -> ScheduleRow | None:
    spec, status = view.schedules.get(name), view.schedule_status.get(name)
    goal, stands = view.wanted.get(name), view.goal_status.get(name)
    holds = tuple(h for h in view.holds.values() if name in h.schedules)
    if spec is not None or status is not None:
        kind, state = "every", status.state.value if status is not None else "unread"
    elif stands is not None and stands.state is GoalState.STANDING and stands.whenever:
        kind, state = "whenever", "paused" if stands.paused else "active"
    elif stands is not None and stands.state is GoalState.PENDING:
        kind, state = "once", "paused" if holds else "waits"
    else:
        return None
    text = goal.text if goal is not None else (stands and stands.understood) or ""
    next_ = status.next if status is not None else None
    if status is None and stands is not None and stands.next_s is not None:
        whole = goal or view.wanted.get(stands.part_of or "")
        shown = None if whole is None else clock_at(whole, stands.next_s, zones_of(whole))
        next_ = None if shown is None else shown.isoformat(timespec="seconds")
    runs = [each for each in view.goal_status.values() if each.part_of == name]
    return ScheduleRow(
        schedule=name,
        kind=kind,
        state=state,
        text=text,
        next=next_,
        spec=spec,
        status=status,
        goal=None if spec is not None else goal,
        goal_status=stands,
        holds=holds,
        latest=tuple(sorted(runs, key=lambda each: -(each.given_wall_s or 0.0))[:LATEST]),
    )


def next_runs(row: ScheduleRow, now_s: float, count: int) -> list[RunTime]:
    """The next `count` runs after `now_s` on the fleet's clock; fewer where there are no more.

    Raises:
        BadArgument: nobody can tell; the message says why.
    """
    stands, status = row.goal_status, row.status
    if row.kind == "whenever" and stands is not None:
        waits = " and ".join(map(str, stands.whenever))
        raise BadArgument(f"{row.schedule} has no times: it is done each time that {waits}")
    if row.kind == "once":
        if stands is None or stands.next_s is None:
            raise BadArgument(f"{row.schedule} has no time: {stands and stands.reason}")
        return [RunTime(schedule=row.schedule, at=row.next, at_s=stands.next_s)]
    if status is None or status.every is None or status.begins_s is None:
        reason = status.reason if status is not None else "no planner has read it yet"
        raise BadArgument(f"{row.schedule} has no times: {reason}")
    begins = None if status.begins is None else datetime.fromisoformat(status.begins)
    if begins is not None and status.zone is not None:
        try:
            begins = begins.astimezone(zone_named(status.zone))
        except UnknownZone as error:
            raise BadArgument(f"{row.schedule}: {error}") from None
    times = Recurrence.of(status.every, status.begins_s, begins)
    return [
        RunTime(
            schedule=row.schedule,
            at=None if begins is None else _iso(moved(begins, at_s - status.begins_s)),
            at_s=at_s,
        )
        for at_s in islice(times.after(now_s), count)
    ]


def _iso(shown: datetime) -> str:
    return shown.isoformat(timespec="seconds")


async def delete_goals(session: Session, names: Sequence[str]) -> None:
    """Take goals back: what was put as a goal or a schedule, and single runs of what is repeated.

    Raises:
        Unknown: there is no such goal.
        BadArgument: it is a part of a goal that goes with that only.
        NotRunning: only a planner can take a run back.
        TooLate: the planner did not say within `DONE_S` that the runs are gone.
    """
    goals = {address.goal for address in await session.list(GOAL_SPEC)}
    schedules = {address.schedule for address in await session.list(SCHEDULE_SPEC)}
    async with fleet_view(session, GOAL_STATUS, SCHEDULE_STATUS) as view:
        runs = view.runs()
        for name in names:
            known = view.goal_status.get(name)
            if known is not None and known.own and name not in goals:
                raise BadArgument(f"{name} is a goal of the planner's own, which ends by itself")
            there = {*goals, *schedules, *runs}
            if name not in there:
                await check_not_deleted(session, name)
            check_known("goal", name, there)
        put, scheduled, made = (
            [name for name in names if name in found] for found in (goals, schedules - goals, runs)
        )
        for run in made:
            whole = view.goal_status[run].part_of or ""
            stands = view.goal_status.get(whole)
            if stands is not None and not stands.whenever and whole not in view.schedule_status:
                raise BadArgument(f"{run} is part of goal {whole}: delete that")
        if made:
            await check_planner(session)
        for name in (*put, *made):
            await session.delete(GOAL_SPEC, GoalAddress(name))
        for name in scheduled:
            await session.delete(SCHEDULE_SPEC, ScheduleAddress(name))
        if held := [*put, *scheduled]:
            await end_holds(session, HoldKind.PAUSE, schedules=held)
        await view.until(
            lambda: not any(run in view.goal_status for run in made),
            DONE_S,
            f"the planner to end {', '.join(made)}",
        )


async def delete_schedules(
    session: Session, rows: Sequence[ScheduleRow], *, with_runs: bool
) -> dict[str, tuple[str, ...]]:
    """Delete these, and pauses of them; the runs that go on, or with `with_runs` went with them.

    Raises:
        NotRunning: runs are to go with it, which only a planner can end.
        BadArgument: one is part of another goal.
        TooLate: the planner did not say within `DONE_S` that they are gone.
    """
    for row in rows:
        whole = row.goal_status.part_of if row.goal_status is not None else None
        if row.spec is None and whole is not None:
            raise BadArgument(
                f"{row.schedule} is part of goal {whole}: delete that with "
                f"`robotctl goal delete {whole}`"
            )
    if with_runs:
        await check_planner(session)
    names = [row.schedule for row in rows]
    async with fleet_view(session, GOAL_STATUS) as view:
        for row in rows:
            if row.spec is not None:
                await session.delete(SCHEDULE_SPEC, ScheduleAddress(row.schedule))
            else:
                await session.delete(GOAL_SPEC, GoalAddress(row.schedule))
        await end_holds(session, HoldKind.PAUSE, schedules=names)
        if with_runs:
            await view.until(
                lambda: not any(name in view.goal_status for name in names),
                DONE_S,
                f"the planner to forget {', '.join(names)}",
            )
        runs = {name: tuple(r for r in view.runs() if _made_by(view, r) == name) for name in names}
        if with_runs:
            ending = [run for of in runs.values() for run in of]
            for run in ending:
                await session.delete(GOAL_SPEC, GoalAddress(run))
            await view.until(
                lambda: not any(run in view.goal_status for run in ending),
                DONE_S,
                f"the planner to end {', '.join(ending)}",
            )
    return runs


def _made_by(view: FleetView, run: str) -> str | None:
    return view.goal_status[run].part_of
