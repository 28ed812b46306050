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
    serial: Annotated[
        str | None,
        typer.Option(
            "--reset-serial",
            metavar="PLANNER/SERIAL",
            help="Take what a planner's lineage orders with a higher serial, whatever came before.",
        ),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="DIR", help="Where its worker keeps what must last."),
    ] = None,
) -> None:
    """Below which planner epoch a robot takes no orders; run it on its host, its worker ended.

    Somebody who may order can order with an epoch that no planner comes to, after which the robot
    refuses its planner for good, with an attempt that keeps those of a task away, or with a serial
    that keeps all away once that attempt is forgotten.
    """
    from cli.processes.data_folder import data_folder
    from workers.orders.fence_reset import fences, forget_attempt, reset_serial

    if sum(each is not None for each in (below, forget, serial)) > 1:
        raise BadArgument("--reset-below, --forget and --reset-serial: one at a time")
    journal = data_folder(data, f"worker-{robot}", call.settings.realm) / f"{robot}.journal"
    if serial is not None:
        found = reset_serial(journal, *_serial(serial))
        if not found.forgotten:
            known = ", ".join(f"{planner}/{highest}" for planner, highest in found.serials)
            raise BadArgument(
                f"{robot} does not refuse what is above {serial}; up to where it does: "
                f"{known or 'nowhere'}"
            )
    elif forget is None:
        found = fences(journal, below)
    else:
        found = forget_attempt(journal, *_attempt(forget))
        if not found.forgotten:
            names = ", ".join(sorted(name for name, _ in found.names)) or "none"
            raise BadArgument(f"{robot} knows no attempt {forget}; those that it knows: {names}")

    def told() -> str:
        if forget is not None:
            return f"{robot} has forgotten attempt {forget}"
        if serial is not None:
            return f"{robot} takes orders above {serial} again"
        if below is not None:
            return (
                f"{robot} has forgotten {found.forgotten} attempts, and takes orders from epoch "
                f"{found.epoch} on"
            )
        kept = ", ".join(map(str, found.attempts)) or "none"
        above = "".join(f"; of {planner} above serial {one}" for planner, one in found.serials)
        return (
            f"{robot} takes orders from epoch {found.epoch} on{above}; epochs of attempts that it "
            f"knows: {kept}"
        )

    call.show(
        {
            "robot": robot,
            "epoch": found.epoch,
            "attempts": found.attempts,
            "names": [{"attempt": name, "revision": of} for name, of in found.names],
            "serials": [{"planner": of, "serial": highest} for of, highest in found.serials],
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


def _serial(name: str) -> tuple[str, int]:
    planner, _, serial = name.rpartition("/")
    if not (serial.isascii() and serial.isdecimal() and len(serial) <= 18):
        raise BadArgument(f"--reset-serial {name}: write PLANNER/SERIAL, as the refusal names them")
    return planner, int(serial)
