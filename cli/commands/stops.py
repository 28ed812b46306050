"""`robotctl stop` and `resume`: the emergency stop, and its end."""

from __future__ import annotations

from typing import Annotated

import typer

from cli.command import Call, single

RobotsOption = Annotated[
    list[str] | None, typer.Option("--robot", metavar="NAME", help="Which; may be repeated.")
]
AllOption = Annotated[bool, typer.Option("--all", help="Every robot, also those that come later.")]
AsOption = Annotated[
    str | None, typer.Option("--as", metavar="WHO", help="Who says so; else user@host.")
]
WAIT_S = 3.0


@single
async def stop(
    call: Call,
    all_: AllOption = False,
    robot: RobotsOption = None,
    why: Annotated[str, typer.Option("--why", metavar="TEXT", help="For those who read it.")] = "",
    wait: Annotated[
        float, typer.Option("--wait", min=0.0, help="How long to wait for their word [s].")
    ] = WAIT_S,
    as_: AsOption = None,
) -> None:
    """Emergency stop: robots come to rest and stay there until `robotctl resume`.

    Workers and simulated drivers obey it by themselves, whether a planner runs or not. Ends with
    exit code 1 while there is a robot that has not confirmed that it rests.
    """
    from cli.client.stops import give_stop

    _which(all_, robot)

    def confirmed(name: str) -> None:
        if not call.json:
            call.inform(f"{name} rests")

    async with call.session() as session:
        outcome = await give_stop(session, robot or (), _who(as_), why, wait, confirmed)
    call.show(outcome, lambda: f"{outcome.stop} stands; `robotctl resume` ends it")
    for name, reason in outcome.unconfirmed.items():
        call.warn(f"NOT CONFIRMED: {name}: {reason}")
    if outcome.unconfirmed:
        raise typer.Exit(1)


@single
async def resume(
    call: Call, all_: AllOption = False, robot: RobotsOption = None, as_: AsOption = None
) -> None:
    """End emergency stops: work goes on from the facts."""
    from cli.client.stops import lift_stops

    _which(all_, robot)
    async with call.session() as session:
        resumed = await lift_stops(session, robot or (), _who(as_))
    free = ", ".join(resumed.robots) or "no robot"
    lifted = ", ".join(resumed.lifted)
    call.show(resumed, lambda: f"{free} may move: {lifted} lifted" if lifted else "No stop stands.")
    for name, stops in resumed.still_held.items():
        call.warn(f"{name} is still held by {'; '.join(stops)}")
    if resumed.still_held:
        raise typer.Exit(1)


def _which(everybody: bool, robots: list[str] | None) -> None:
    if everybody == bool(robots):
        raise typer.BadParameter("say either --all or --robot NAME")


def _who(said: str | None) -> str:
    """Who gives the command, as `user@host` unless said otherwise."""
    import getpass
    import socket

    if said:
        return said
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # nobody has a name in a bare container
        user = "somebody"
    return f"{user}@{socket.gethostname()}"
