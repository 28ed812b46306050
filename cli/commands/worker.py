"""`robotctl worker`: the workers of robots, in one process or in several."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli import completion
from cli.command import Call, single
from cli.commands.processes import DataOption
from cli.processes.data_folder import data_folder

SIM = "sim"
"""The embodiment that is not a plug-in."""
EmbodimentOption = Annotated[
    str, typer.Option("--embodiment", help="What drives the robots; `sim` or a plug-in's name.")
]


@single
def worker(
    call: Call,
    robots: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="ROBOT",
            help="Which registered robots; one process for all.",
            autocompletion=completion.robots,
        ),
    ] = None,
    every: Annotated[
        bool, typer.Option("--all", help="Every registered robot that has no worker now.")
    ] = False,
    follow: Annotated[
        bool,
        typer.Option("--follow", help="With --all: also of those registered later, as they come."),
    ] = False,
    data: DataOption = None,
    embodiment: EmbodimentOption = SIM,
    keep: Annotated[
        int,
        typer.Option(
            "--keep", metavar="N", min=0, help="Attempts that are over a journal keeps, at most."
        ),
    ] = 100,
    keep_days: Annotated[
        float, typer.Option("--keep-days", metavar="DAYS", min=0.0, help="And for how long.")
    ] = 7.0,
) -> None:
    """Run the workers of robots: they take orders and carry them out.

    With --all those of every robot that is registered and has none, as far as a router tells now;
    with --follow of every one that is, or is later. Who is unregistered has none any more.
    """
    from cli.errors import BadArgument, check_known
    from cli.processes.child_processes import end_with_parent
    from keyexpr_schema.plug_ins import plug_in_names
    from sim.embodiment import sim_embodiment
    from workers.embodiment import EMBODIMENTS, installed_embodiment
    from workers.orders.journal import Retention
    from workers.process import run_workers

    check_known("embodiment", embodiment, [SIM, *plug_in_names(EMBODIMENTS)])
    if bool(robots) == every:
        raise BadArgument("name the robots, or say --all for all without a worker; one of both")
    if follow and not every:
        raise BadArgument("--follow goes with --all")
    if every and not follow:
        import asyncio

        robots = asyncio.run(_without_worker(call))
    robots = robots or []
    for robot in robots:
        if robots.count(robot) > 1:
            raise BadArgument(f"{robot} is named twice: a robot has one worker")
    end_with_parent()

    def folder_of(robot: str) -> Path:
        return data_folder(data, f"worker-{robot}", call.settings.realm)

    run_workers(
        {robot: folder_of(robot) for robot in robots},
        call.settings.routers,
        call.settings.realm,
        sim_embodiment if embodiment == SIM else installed_embodiment(embodiment),
        retention=Retention(count=keep, age_s=keep_days * 24 * 3600.0),
        zenoh_config=call.settings.zenoh_config,
        registered=folder_of if follow else None,
    )


async def _without_worker(call: Call) -> list[str]:
    """The registered robots whose workers are not connected.

    Raises:
        NotRunning: each has one, or there are no robots.
    """
    from cli.client.presence import robots_alive
    from cli.errors import HOW_TO_ADD, NotRunning
    from keyexpr_schema.keyspace import ROBOT_SPEC

    async with call.session() as session:
        known = sorted(address.robot for address in await session.list(ROBOT_SPEC))
        alive = await robots_alive(session)
    if not known:
        raise NotRunning(f"there is no robot to work for: {HOW_TO_ADD['robot']}")
    left = [robot for robot in known if robot not in alive]
    if not left:
        raise NotRunning(f"every robot has a worker already: {', '.join(known)}")
    call.inform(f"workers of {', '.join(left)}")
    return left
