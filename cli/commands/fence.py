"""`robotctl fence`: which orders a robot takes, and how it takes those of its planner again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.arguments import RobotArgument
from cli.command import Call, single


@single
def fence(
    call: Call,
    robot: RobotArgument,
    below: Annotated[
        int | None,
        typer.Option(
            "--reset-below",
            min=1,
            metavar="EPOCH",
            help="Forget all that was ordered with this epoch or a higher one.",
        ),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="DIR", help="Where its worker keeps what must last."),
    ] = None,
) -> None:
    """Below which planner epoch a robot takes no orders; run it on its host, its worker ended.

    Somebody who may order can order with an epoch that no planner comes to, after which the robot
    refuses its planner for good.
    """
    from cli.processes.data_folder import data_folder
    from workers.orders.fence_reset import fences

    folder = data_folder(data, f"worker-{robot}", call.settings.realm)
    found = fences(folder / f"{robot}.journal", below)

    def told() -> str:
        if below is not None:
            return (
                f"{robot} has forgotten {found.forgotten} attempts, and takes orders from epoch "
                f"{found.epoch} on"
            )
        kept = ", ".join(map(str, found.attempts)) or "none"
        return f"{robot} takes orders from epoch {found.epoch} on; attempts that it knows: {kept}"

    call.show(
        {
            "robot": robot,
            "epoch": found.epoch,
            "attempts": found.attempts,
            "forgotten": found.forgotten,
        },
        told,
    )
