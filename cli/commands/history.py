"""`robotctl history`: what is over."""

from __future__ import annotations

from typing import Annotated

import typer

from cli import completion
from cli.command import Call, command, group, single, without_command

LAST = 50

app = group("What was wanted, what came of it, who did it, how long it took.")
SinceOption = Annotated[
    str | None,
    typer.Option(
        "--since",
        metavar="TIME|SPAN",
        help="Only what ended since: 2026-11-28, 14:30, or so long ago: 2h, 7d.",
    ),
]


@without_command(app)
async def history(
    call: Call,
    since: SinceOption = None,
    goal: Annotated[
        str | None,
        typer.Option(
            "--goal",
            metavar="GOAL",
            help="Only what is about this goal.",
            autocompletion=completion.goals,
        ),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot",
            metavar="ROBOT",
            help="Only what this robot did.",
            autocompletion=completion.robots,
        ),
    ] = None,
    last: Annotated[
        int, typer.Option("--last", metavar="N", min=1, help="At most the newest so many.")
    ] = LAST,
) -> None:
    """What was wanted, what came of it, who did it, how long it took; newest first.

    The planner keeps all that is over in its archive, long after its keys are deleted.
    """
    from cli.client.history import past_entries
    from cli.views.history import history_table
    from keyexpr_schema.ids import check_id
    from keyexpr_schema.payloads.history import HistoryQuery

    query = HistoryQuery(
        since_wall_s=_since_s(since),
        goal=check_id(goal, "goal") if goal is not None else None,
        robot=check_id(robot, "robot") if robot is not None else None,
    )
    async with call.session() as session:
        entries = await past_entries(session, query, last)
    call.show(entries, lambda: history_table(entries) if entries else "Nothing such is over yet.")


@command(app, "stats")
async def stats(call: Call, since: SinceOption = None) -> None:
    """Goals reached and failed with reasons, time to goal, utilisation, replans, by day."""
    from datetime import datetime

    from cli.client.history import history_stats
    from cli.views.history import stats_page
    from keyexpr_schema.payloads.history import HistoryStatsQuery

    offset = datetime.now().astimezone().utcoffset()
    query = HistoryStatsQuery(
        since_wall_s=_since_s(since), utc_offset_s=int(offset.total_seconds()) if offset else 0
    )
    async with call.session() as session:
        found = await history_stats(session, query)
    call.show(found, lambda: stats_page(found))


@single
async def audit(
    call: Call,
    since: SinceOption = None,
    by: Annotated[
        str | None, typer.Option("--by", metavar="WHO", help="Only what they did, as ana@lab.")
    ] = None,
    about: Annotated[
        str | None,
        typer.Option("--about", metavar="NAME", help="Only what is about it: a goal, a robot …"),
    ] = None,
    last: Annotated[
        int, typer.Option("--last", metavar="N", min=1, help="At most the newest so many.")
    ] = LAST,
) -> None:
    """Who did what: all that people have put and deleted; newest first.

    It comes from the planner's audit log, which only grows.
    """
    from cli.client.history import audit_entries
    from cli.views.history import audit_table
    from keyexpr_schema.payloads.audit import AuditQuery

    query = AuditQuery(since_wall_s=_since_s(since), by=by, about=about, limit=last)
    async with call.session() as session:
        page = await audit_entries(session, query)
    call.show(page, lambda: audit_table(page) if page.entries else "Nobody has done anything such.")


def _since_s(written: str | None) -> float | None:

    from cli.times import now_here, parse_since

    if written is None:
        return None
    return parse_since(written, "--since", now_here())
