"""`robotctl health`: whether processes of the fleet are well, in a line and an exit code."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cli import completion
from cli.command import Call, single

if TYPE_CHECKING:
    from cli.client.health_checks import Asked, Verdict

CONNECTING = 0.75
"""The part of the time in which a router must let us in: some is left to say that none did."""


@single
def health(
    call: Call,
    role: Annotated[
        str | None,
        typer.Argument(
            metavar="ROLE",
            help="router, planner, worker, recorder or sim; else the whole fleet.",
            autocompletion=completion.roles,
        ),
    ] = None,
    robots: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="ROBOT",
            help="Whose workers; else those of all that are registered.",
            autocompletion=completion.robots,
        ),
    ] = None,
    timeout_s: Annotated[
        float, typer.Option("--timeout", min=0.1, metavar="SECONDS", help="Then it is not well.")
    ] = 4.0,
    live: Annotated[
        bool,
        typer.Option(
            "--live",
            help="Exit 1 only where starting it again may help: no cut line, no full disk.",
        ),
    ] = False,
    store: Annotated[
        bool, typer.Option("--store/--no-store", help="Whether the router has a store behind it.")
    ] = True,
) -> None:
    """Say in a line whether a process, or the fleet, is well; exit 1 if not.

    For health checks of containers: whatever happens, it is said within --timeout.
    """
    import asyncio
    import os
    import sys
    import threading
    from concurrent.futures import Future

    from cli.client.health_checks import ROLES, ROUTER, WORKER, Asked, Verdict, unreached
    from cli.errors import BadArgument, check_known
    from keyexpr_schema.ids import check_name

    if role is not None:
        check_known("role", role, ROLES)
    if robots and role != WORKER:
        raise BadArgument(f"only workers are of robots: `robotctl health worker {robots[0]}`")
    if not store and role != ROUTER:
        raise BadArgument("--no-store is of a router: `robotctl health router --no-store`")
    for robot in robots or ():
        check_name(robot, "robot")
    asked = Asked(role, tuple(dict.fromkeys(robots or ())), store)
    found: Future[Verdict] = Future()

    def ask() -> None:
        try:
            found.set_result(asyncio.run(_verdict(call, asked, timeout_s)))
        except BaseException as error:
            found.set_exception(error)

    threading.Thread(target=ask, daemon=True).start()
    try:
        verdict = found.result(timeout_s)
    except TimeoutError:
        said = f"nothing answered within {timeout_s:g} s"
        verdict = Verdict.of([unreached(asked, said)])
    call.show(verdict, lambda: verdict.line)
    code = int(not (verdict.well or (live and not verdict.restart_helps)))
    if not found.done():
        # Zenoh does not let go of a router that is frozen, and Python would wait for it.
        sys.stdout.flush()
        os._exit(code)
    raise typer.Exit(code)


async def _verdict(call: Call, asked: Asked, timeout_s: float) -> Verdict:
    from cli.client.health_checks import Verdict, look, unreached
    from keyexpr_schema.errors import BadZenohConfig, SchemaError

    try:
        connecting_s = CONNECTING * timeout_s
        async with call.session(asked.component, connecting_s, urgent=not asked.store) as session:
            return await look(session, asked)
    except BadZenohConfig:
        raise
    except SchemaError as error:
        return Verdict.of([unreached(asked, str(error))])
