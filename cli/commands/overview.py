"""`robotctl status`, `watch`, `journal`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from cli.command import Call, command

if TYPE_CHECKING:
    from rich.console import RenderableType

    from keyexpr_schema.transport.session import Change

status_app = typer.Typer(rich_markup_mode=None, add_completion=False)
watch_app = typer.Typer(rich_markup_mode=None, add_completion=False)
journal_app = typer.Typer(rich_markup_mode=None, add_completion=False)


@command(status_app)
async def status(call: Call) -> None:
    """The whole fleet on one page: router, planner, robots, goals, plans, unreadable values."""
    from cli.board import FLEET, following
    from cli.presence import planner_alive, robots_alive
    from cli.show.fleet_tables import goal_rows, robot_row
    from cli.show.status_page import status_page
    from cli.telling import planner_status
    from cli.unreadable import still_unreadable
    from keyexpr_schema.keyspace import REJECT

    async with call.session() as session:
        async with following(session, *FLEET, REJECT) as board:
            pass
        planner = await planner_status(session)
        planning = await planner_alive(session)
        alive = await robots_alive(session)
        rejects = await still_unreadable(session, board.rejects.values())
    robots = [
        robot_row(name, board.specs.get(name), board.robots.get(name), name in alive)
        for name in sorted(set(board.specs) | alive)
    ]
    goals = goal_rows(board.goals, board.goal_status)
    settings = call.settings
    call.show(
        {
            "routers": settings.routers,
            "realm": settings.realm,
            "planner": {"running": planning, "status": planner},
            "robots": robots,
            "goals": goals,
            "plans": list(board.plan_status.values()),
            "rejects": rejects,
        },
        lambda: status_page(
            settings.routers, settings.realm, planner, planning, robots, goals, board, rejects
        ),
    )


@command(watch_app)
async def watch(
    call: Call,
    plan: Annotated[
        str | None, typer.Argument(metavar="PLAN", help="Only this plan; else all.")
    ] = None,
) -> None:
    """Follow goals, plans and tasks until Ctrl-C.

    On a terminal a picture; piped, a line a change; with --json, a JSON document a line.
    """
    from cli.board import FLEET, SIMULATION, following
    from cli.show.live import Ticker, showing

    if call.json:
        async with (
            call.session() as session,
            following(session, *FLEET, on_change=_as_json) as all_,
        ):
            await all_.forever()
    ticker = Ticker(to_stderr=False, only=plan)
    async with (
        call.session() as session,
        following(session, *FLEET, *SIMULATION, on_change=ticker.hear) as board,
        showing(board, ticker, plan),
    ):
        await board.forever()


def _as_json(change: Change[Any, Any]) -> None:
    import msgspec

    what = {"key": change.key.build(change.address), "value": change.value}
    typer.echo(msgspec.json.encode(what).decode())


@command(journal_app)
async def journal(
    call: Call,
    after: Annotated[int, typer.Option("--after", min=0, help="Only entries after this.")] = 0,
    limit: Annotated[int, typer.Option("--limit", min=1, help="At most so many.")] = 1000,
) -> None:
    """What changed in the key-space, in the order in which the store applied it."""
    from keyexpr_schema.keyspace import STORE_JOURNAL
    from keyexpr_schema.payloads.service import StoreAddress, StoreJournal, StoreQuery

    async with call.session() as session:
        # What a query key replies is not in its type; the key table says it is a StoreJournal.
        told: StoreJournal = await session.ask(
            STORE_JOURNAL, StoreAddress(), StoreQuery(after=after, limit=limit)
        )

    def draw() -> RenderableType:
        from cli.show.status_page import journal_table

        return journal_table(told) if told.entries else "The journal has no such entries."

    call.show(told, draw)
