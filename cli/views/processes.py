"""The processes of a `robotctl up` as a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cli.times import moment
from cli.views.console import table

if TYPE_CHECKING:
    from rich.table import Table

    from cli.processes.up_state import UpState


def processes_table(up: UpState) -> Table:
    """A row a process, with `up` itself first."""
    own = up.process.pid if up.process else None
    rows: list[tuple[object, ...]] = [("up", own, moment(up.since_wall_s), "", up.endpoint)]
    for child in up.children:
        pid = child.process.pid if child.process else "ended"
        rows.append((child.name, pid, moment(child.since_wall_s), child.restarts, child.log))
    return table(("process", "pid", "up since", "restarts", "listens, or log"), rows)
