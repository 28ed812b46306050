"""`robotctl schedule`: what is wanted again and again, or later."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cli.arguments import AnySchedulesArgument, SchedulesArgument, WhyOption
from cli.command import Call, command, group

if TYPE_CHECKING:
    from cli.client.fleet_view import FleetView


app = group("What is wanted again and again, or later (`robotctl goal add … --every`).")


async def _view(call: Call) -> FleetView:
    from cli.client.fleet_view import snapshot
    from cli.client.schedules import KEYS

    async with call.session() as session:
        return await snapshot(session, *KEYS)


@command(app, "list")
async def list_(call: Call) -> None:
    """Schedules, goals that stand by for something, and goals whose time has not come."""
    from cli.client.schedules import schedule_rows
    from cli.views.schedules import schedules_table

    rows = schedule_rows(await _view(call))
    call.show(rows, lambda: schedules_table(rows) if rows else "No schedules.")


@command(app, "show")
async def show(call: Call, schedules: SchedulesArgument) -> None:
    """When each is done, what comes next, and what became of its runs."""
    from rich.console import Group

    from cli.client.schedules import chosen, schedule_rows
    from cli.views.schedules import schedule_page

    rows = chosen(schedule_rows(await _view(call)), schedules)
    call.show(rows, lambda: Group(*map(schedule_page, rows)))


@command(app, "next")
async def next_(
    call: Call,
    schedules: AnySchedulesArgument = None,
    count: Annotated[int, typer.Option("-n", min=1, max=1000, help="How many runs.")] = 5,
) -> None:
    """When the next runs begin: of these schedules, each, or of all, in order."""
    from cli.client.fleet_view import snapshot
    from cli.client.publish import fleet_time_s
    from cli.client.schedules import KEYS, chosen, next_runs, schedule_rows
    from cli.views.schedules import runs_table

    async with call.session() as session:
        rows = schedule_rows(await snapshot(session, *KEYS))
        now_s = await fleet_time_s(session)
    if schedules:
        runs = [run for row in chosen(rows, schedules) for run in next_runs(row, now_s, count)]
    else:
        timed = [row for row in rows if row.next is not None]
        runs = [run for row in timed for run in next_runs(row, now_s, count)]
        runs = sorted(runs, key=lambda run: (run.at_s, run.schedule))[:count]
    call.show(runs, lambda: runs_table(runs) if runs else "No run is to come.")


@command(app, "pause")
async def pause(call: Call, schedules: SchedulesArgument, why: WhyOption = "") -> None:
    """Begin no run until `robotctl schedule resume`: times that pass get none.

    What runs goes on.
    """
    from cli.client.fleet_view import snapshot
    from cli.client.holds import in_words, put_holds
    from cli.client.schedules import KEYS, chosen, schedule_rows
    from keyexpr_schema.payloads.holds import HoldKind

    async with call.session() as session:
        rows = chosen(schedule_rows(await snapshot(session, *KEYS)), schedules)
        free = [row.schedule for row in rows if not row.holds]
        put = (
            await put_holds(session, HoldKind.PAUSE, (), (), call.by, why, schedules=free)
            if free
            else None
        )
    holds = [*(hold for row in rows for hold in row.holds), *(put.holds if put else ())]
    call.show(holds, lambda: "\n".join(map(in_words, holds)))


@command(app, "resume")
async def resume(call: Call, schedules: SchedulesArgument) -> None:
    """End pauses of schedules: the next time gets its run again."""
    from cli.client.fleet_view import snapshot
    from cli.client.holds import end_holds, in_words
    from cli.client.schedules import KEYS, chosen, schedule_rows
    from keyexpr_schema.payloads.holds import HoldKind

    async with call.session() as session:
        chosen(schedule_rows(await snapshot(session, *KEYS)), schedules)
        ended = await end_holds(session, HoldKind.PAUSE, schedules=schedules)
    lines = [f"no longer: {in_words(hold)}" for hold in ended]
    call.show(ended, lambda: "\n".join(lines) or f"{', '.join(schedules)} was not paused.")


@command(app, "delete")
async def delete(
    call: Call,
    schedules: SchedulesArgument,
    with_runs: Annotated[
        bool, typer.Option("--with-runs", help="Take back the runs that go on, too.")
    ] = False,
) -> None:
    """Delete schedules and goals for later; a run that goes on does so."""
    from cli.client.fleet_view import snapshot
    from cli.client.schedules import KEYS, chosen, delete_schedules, schedule_rows

    async with call.session() as session:
        rows = chosen(schedule_rows(await snapshot(session, *KEYS)), schedules)
        runs = await delete_schedules(session, rows, with_runs=with_runs)
    with_them = "taken back with it" if with_runs else "goes on"
    said = {name: f"; {', '.join(of)}: {with_them}" if of else "" for name, of in runs.items()}
    call.show(
        {"deleted": list(runs), "taken_back" if with_runs else "going_on": runs},
        lambda: "\n".join(f"deleted {name}{more}" for name, more in said.items()),
    )
