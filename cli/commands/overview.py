"""`robotctl status`, `watch`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import typer

from cli.arguments import AnyPlanArgument
from cli.command import Call, single

if TYPE_CHECKING:
    from keyexpr_schema.payloads.system import UndecodableValue
    from keyexpr_schema.transport.session import Change, Session

ASK_S = 3.0


@single
async def status(call: Call) -> None:
    """The whole fleet on one page: router, planner, robots, goals, plans, unreadable values."""
    from asyncio import gather

    from cli.client.fleet_view import FLEET_KEYS, snapshot
    from cli.client.planner_requests import planner_status
    from cli.client.presence import planner_alive, robots_alive
    from cli.views.goals import goal_rows
    from cli.views.robots import robot_rows
    from cli.views.status import status_page
    from keyexpr_schema.keyspace import DIAGNOSTIC, UNDECODABLE

    async with call.session() as session:
        view = await snapshot(session, *FLEET_KEYS, UNDECODABLE)
        planner = await planner_status(session)
        # Where nobody is, each waits for a moment.
        planning, connected = await gather(planner_alive(session), robots_alive(session))
        undecodable = await _still_undecodable(session, view.undecodable.values())
        diagnostics = list((await session.list(DIAGNOSTIC)).values())
    robots = robot_rows(view.robot_specs, view.robot_states, connected)
    goals = goal_rows(view.wanted, view.goal_status)
    settings = call.settings
    call.show(
        {
            "routers": settings.routers,
            "realm": settings.realm,
            "planner": {"running": planning, "status": planner},
            "robots": robots,
            "goals": goals,
            "plans": list(view.plan_status.values()),
            "diagnostics": diagnostics,
            "stops": list(view.stops.values()),
            "holds": list(view.holds.values()),
            "closures": view.standing_closures(),
            "schedules": list(view.schedule_status.values()),
            "rejects": undecodable,
        },
        lambda: status_page(
            settings.routers,
            settings.realm,
            planner,
            planning,
            robots,
            goals,
            view,
            diagnostics,
            undecodable,
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
    plan: AnyPlanArgument = None,
) -> None:
    """Follow goals, plans and tasks until Ctrl-C.

    On a terminal a picture; piped, a line a change; with --json, a JSON document a line.
    """
    from cli.client.fleet_view import FLEET_KEYS, SIMULATION_KEYS, fleet_view
    from cli.views.live import ChangePrinter, live_view

    if call.json:
        async with (
            call.session() as session,
            fleet_view(session, *FLEET_KEYS, on_change=_as_json) as all_,
        ):
            await all_.forever()
    printer = ChangePrinter(to_stderr=False, only=plan)
    async with (
        call.session() as session,
        fleet_view(session, *FLEET_KEYS, *SIMULATION_KEYS, on_change=printer.on_change) as view,
        live_view(view, printer, plan),
    ):
        await view.forever()


def _as_json(change: Change[Any, Any]) -> None:
    import msgspec

    what = {"key": change.key.build(change.address), "value": change.value}
    typer.echo(msgspec.json.encode(what).decode())
