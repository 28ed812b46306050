"""`robotctl why`."""

from __future__ import annotations

from typing import Annotated

import typer

from cli import completion
from cli.command import Call, single


@single
async def why(
    call: Call,
    name: Annotated[
        str,
        typer.Argument(
            metavar="GOAL|PLAN|PLAN/TASK",
            help="What waits, runs, or has ended.",
            autocompletion=completion.what_waits,
        ),
    ],
) -> None:
    """Tell why a goal, a plan or a task waits, to the end of the chain; or what it does, or why it
    ended.
    """
    from cli.client.fleet_view import FLEET_KEYS, snapshot
    from cli.client.health import health
    from cli.client.history import deletions_of
    from cli.errors import check_known
    from cli.views.why import why_page
    from cli.why.chain import explain
    from cli.why.deletions import deleted_for

    async with call.session() as session:
        view = await snapshot(session, *FLEET_KEYS)
        gone = deleted_for(view, name.partition("/")[0])
        deletions = await deletions_of(session, gone) if gone else {}
        found = explain(view, name, await health(session), deletions)
    if not found:
        plan, slash, task = name.partition("/")
        if slash:
            check_known("plan", plan, view.plan_status)
            check_known(f"task of plan {plan}", task, view.records(plan))
        check_known("goal or plan", name, {*view.goals, *view.goal_status, *view.plan_status})
    call.show(found, lambda: why_page(found))
