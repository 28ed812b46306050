"""`robotctl status`, `watch`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cli import completion
from cli.arguments import AnyPlanArgument
from cli.command import Call, single
from cli.terminal import json_text

if TYPE_CHECKING:
    from rich.console import RenderableType

    from keyexpr_schema.payloads.system import UndecodableValue
    from keyexpr_schema.transport.session import Change, Session

ASK_S = 3.0


OnlyRobots = Annotated[
    list[str] | None,
    typer.Option(
        "--robot",
        metavar="NAME",
        help="Only what concerns this robot; repeatable.",
        autocompletion=completion.robots,
    ),
]
OnlyGoals = Annotated[
    list[str] | None,
    typer.Option(
        "--goal",
        metavar="NAME",
        help="Only what concerns this goal; repeatable.",
        autocompletion=completion.goals,
    ),
]
OnlyPlans = Annotated[
    list[str] | None,
    typer.Option(
        "--plan",
        metavar="NAME",
        help="Only what concerns this plan; repeatable.",
        autocompletion=completion.plans,
    ),
]
NeedsMe = Annotated[bool, typer.Option("--needs-me", help="Only what needs a person.")]
Ended = Annotated[bool, typer.Option("--ended", help="Show what is over, too, one by one.")]


@single
async def status(
    call: Call,
    robot: OnlyRobots = None,
    goal: OnlyGoals = None,
    plan: OnlyPlans = None,
    needs_me: NeedsMe = False,
    ended: Ended = False,
    whole: Annotated[
        bool, typer.Option("--all", help="Everything, also where that is longer than the screen.")
    ] = False,
) -> None:
    """The fleet on one page: what needs a person, what runs, what waits and why, and robots.

    On a terminal it is no longer than the screen: what does not fit is counted.
    """
    import sys
    from asyncio import gather
    from time import time

    from cli.client.fleet_view import FLEET_KEYS, snapshot
    from cli.client.planner_requests import planner_status
    from cli.client.presence import planner_alive, robots_alive
    from cli.errors import check_known
    from cli.overview.needs import needs_of
    from cli.overview.page import FleetPage
    from cli.overview.situation import Filters, Situation
    from cli.views.goals import goal_row
    from cli.views.robots import robot_rows
    from cli.views.status import head_lines
    from keyexpr_schema.keyspace import DIAGNOSTIC, UNDECODABLE
    from keyexpr_schema.payloads.system import Diagnostic

    async with call.session() as session:
        view = await snapshot(session, *FLEET_KEYS, UNDECODABLE)
        for what, names, known in (
            ("robot", robot, view.robot_specs),
            ("goal", goal, {**view.wanted, **view.goal_status}),
            ("plan", plan, view.plan_status),
        ):
            for name in names or ():
                check_known(what, name, known)
        planner = await planner_status(session)
        # Where nobody is, each waits for a moment.
        planning, connected = await gather(planner_alive(session), robots_alive(session))
        undecodable = await _still_undecodable(session, view.undecodable.values())
        diagnostics = list((await session.list(DIAGNOSTIC)).values())
        if (failing := await session.store_failing()) is not None:
            told = Diagnostic(component="router", check="store", sentence=failing, since_s=time())
            diagnostics.append(told)
    filters = Filters.of(robot, goal, plan)
    shown = Situation(view, filters, connected, diagnostics, undecodable)
    settings = call.settings
    robots = {name for name, *_ in shown.robots}
    head = head_lines(settings.routers, settings.realm, planner, planning, offers=whole)
    call.show(
        {
            "routers": settings.routers,
            "realm": settings.realm,
            "planner": {"running": planning, "status": planner},
            "needs_person": needs_of(shown),
            "running": shown.running,
            "waiting": shown.waiting,
            "robots": [
                row
                for row in robot_rows(view.robot_specs, view.robot_states, connected)
                if row.robot in robots
            ],
            "goals": [
                goal_row(status.goal, view.wanted, view.goal_status)
                for status in shown.goals
                if status.goal in view.wanted
            ],
            "plans": shown.every_plan,
            "diagnostics": diagnostics,
            "stops": list(view.stops.values()),
            "holds": list(view.holds.values()),
            "closures": view.standing_closures(),
            "schedules": list(view.schedule_status.values()),
            "rejects": undecodable,
        },
        lambda: FleetPage(
            shown,
            head,
            whole=whole or not sys.stdout.isatty(),
            needs_me=needs_me,
            ended=ended,
        ),
    )


async def _still_undecodable(
    session: Session, values: Iterable[UndecodableValue]
) -> list[UndecodableValue]:
    """Those whose key still has a value that does not decode, or the one that was of no use.

    The report stays on its key when the bad value is replaced or deleted. What is not stored, and
    what was put on a key that nobody can have, cannot be looked at again and stays listed.
    """
    from keyexpr_schema.errors import ForeignKey, UndecodablePayload
    from keyexpr_schema.keyspace import key_of
    from keyexpr_schema.transport.undecodable import digest_of

    left = []
    for value in values:
        try:
            key = key_of(value.keyexpr)
            if key.stored:
                now = await session.get(key, key.parse(value.keyexpr), ASK_S)
                if now is None or value.digest != digest_of(key.encode(now)):
                    continue
        except (ForeignKey, UndecodablePayload):
            pass
        left.append(value)
    return left


@single
async def watch(
    call: Call,
    only: AnyPlanArgument = None,
    robot: OnlyRobots = None,
    goal: OnlyGoals = None,
    plan: OnlyPlans = None,
    needs_me: NeedsMe = False,
    ended: Ended = False,
) -> None:
    """Follow goals, plans and tasks until Ctrl-C; one plan alone as a tree.

    On a terminal a picture; piped, a line a change; with --json, a JSON document a line.
    """
    from cli.client.fleet_view import FLEET_KEYS, SIMULATION_KEYS, FleetView, fleet_view
    from cli.overview.page import FleetPage
    from cli.overview.situation import Filters, Situation
    from cli.views.live import ChangePrinter, clock_line, live_view, picture

    if call.json:
        async with (
            call.session() as session,
            fleet_view(session, *FLEET_KEYS, on_change=_as_json) as all_,
        ):
            await all_.forever()
    filters = Filters.of(robot, goal, [*(plan or ()), *([only] if only else ())])
    printer = ChangePrinter(to_stderr=False, only=filters)

    def draw(view: FleetView) -> RenderableType:
        if only is not None:
            return picture(view, only)
        situation = Situation(view, filters)
        return FleetPage(situation, clock_line(view), needs_me=needs_me, ended=ended)

    async with (
        call.session() as session,
        fleet_view(session, *FLEET_KEYS, *SIMULATION_KEYS, on_change=printer.on_change) as view,
        live_view(view, printer, draw),
    ):
        await view.forever()


def _as_json(change: Change[Any, Any]) -> None:
    import msgspec

    from cli.times import with_iso

    what = {"key": change.key.build(change.address), "value": change.value}
    plain = msgspec.to_builtins(what, str_keys=True)
    typer.echo(json_text(msgspec.json.encode(with_iso(plain))))
