"""`robotctl fence`: which orders a robot takes, and how it takes those of its planner again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.arguments import RobotArgument
from cli.command import Call, single
from cli.errors import BadArgument


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
    forget: Annotated[
        str | None,
        typer.Option(
            "--forget",
            metavar="PLAN/TASK/ATTEMPT",
            help="Forget one attempt, ordered by nobody who may, that keeps later ones away.",
        ),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="DIR", help="Where its worker keeps what must last."),
    ] = None,
) -> None:
    """Below which planner epoch a robot takes no orders; run it on its host, its worker ended.

    Somebody who may order can order with an epoch that no planner comes to, after which the robot
    refuses its planner for good, or with an attempt that keeps those of a task away.
    """
    from cli.processes.data_folder import data_folder
    from workers.orders.fence_reset import fences, forget_attempt

    if below is not None and forget is not None:
        raise BadArgument("--reset-below and --forget: one at a time")
    journal = data_folder(data, f"worker-{robot}", call.settings.realm) / f"{robot}.journal"
    if forget is None:
        found = fences(journal, below)
    else:
        found = forget_attempt(journal, *_attempt(forget))
        if not found.forgotten:
            names = ", ".join(sorted(name for name, _ in found.names)) or "none"
            raise BadArgument(f"{robot} knows no attempt {forget}; those that it knows: {names}")

    def told() -> str:
        if forget is not None:
            return f"{robot} has forgotten attempt {forget}"
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
            "names": [{"attempt": name, "revision": of} for name, of in found.names],
            "forgotten": found.forgotten,
        },
        told,
    )


def _attempt(name: str) -> tuple[str, str, int]:
    plan, _, rest = name.partition("/")
    task, _, attempt = rest.partition("/")
    if not (plan and task and attempt.isascii() and attempt.isdecimal() and len(attempt) <= 18):
        raise BadArgument(f"--forget {name}: write PLAN/TASK/ATTEMPT, such as plan-1/t3/1000000")
    return plan, task, int(attempt)
