"""What was learned of durations, as a table."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rich.table import Table

from cli.show.page import table
from cli.show.words import seconds
from keyexpr_schema.payloads.durations import Durations


def durations_table(rows: Iterable[Durations]) -> Table:
    """A line for each skill of each type of robot, and one for its pace."""
    return table(["model", "what", "mean", "sd", "attempts"], _lines(rows))


def _lines(rows: Iterable[Durations]) -> Iterator[tuple[str, ...]]:
    for known in rows:
        if known.pace is not None:
            what = "pace (1: top speed all the way)"
            pace = known.pace
            yield known.model, what, f"{pace.mean:.2f}", f"{pace.sd:.2f}", str(pace.count)
        for skill, each in sorted(known.skills.items()):
            yield known.model, skill, seconds(each.mean), seconds(each.sd), str(each.count)
