"""`robotctl store`: putting right what the router's store keeps, on its host."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from cli.command import Call, command, group

app = group("Put the router's store right, on its host, while the router is not running.")

SHOWN = 20
"""Keys that are named; of more the rest is counted."""


@app.callback()
def store() -> None:
    """Put the router's store right, on its host, while the router is not running."""


@command(app, "repair-clock")
def repair_clock(
    call: Call,
    data: Annotated[
        Path | None,
        typer.Option("--data", metavar="DIR", help="The router's; else in ~/.local/share."),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only show what would change.")
    ] = False,
) -> None:
    """Put a store right in which a clock that was ahead has left values that nobody can change.

    What has a stamp that is still to come gets one of now; no value changes. Set the clocks of all
    hosts first, and end router, planner and workers: they go on with the time that they have seen.
    """
    from cli.processes.data_folder import data_folder
    from fleet.stores.clock_repair import repair, stamped_ahead
    from keyexpr_schema.transport.clock_skew import span

    folder = data_folder(data, "router")
    found = (stamped_ahead if dry_run else repair)(folder, time.time())

    def words() -> str:
        if not found:
            return f"no stamp in {folder} is ahead of the clock of this host: nothing to repair"
        would = "would get" if dry_run else "has got"
        lines = [
            f"{each.key}{' (deleted)' if each.deleted else ''} {would} a stamp of now; its own is "
            f"{span(each.ahead_s)} ahead"
            for each in found[:SHOWN]
        ]
        if len(found) > SHOWN:
            lines.append(f"and {len(found) - SHOWN} more")
        last = "nothing was changed" if dry_run else "start the router, the planner and the workers"
        return "\n".join([*lines, f"{len(found)} in all; {last}"])

    call.show({"folder": str(folder), "repaired": not dry_run, "ahead": found}, words)
