"""The head of the page of `status`, and the store's journal."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from cli.views.console import table
from keyexpr_schema.payloads.system import (
    JournalEntry,
    StoreJournal,
)

if TYPE_CHECKING:
    from cli.client.health import Health

VALUE_WIDTH = 120
"""Characters of a value shown in the journal; `--json` shows all of it."""


def head_lines(
    routers: Sequence[str],
    realm: str,
    health: Health,
    offers: bool = False,
) -> list[Text]:
    """Where the fleet is, and who plans in it; with `offers` also what can be asked of that."""
    lines = [Text(f"router   {', '.join(routers)}, realm {realm}")]
    planner = health.planner
    if not health.planning:
        missing = "planner  not running (start one with `robotctl planner`)"
        return [*lines, Text(missing, "red")]
    if planner is None:
        return [*lines, Text("planner  running")]
    lines.append(Text(f"planner  running, epoch {planner.epoch}"))
    known = (
        ("strategies", planner.strategies),
        ("planners", planner.planners),
        ("allocators", planner.allocators),
        ("skills", planner.skills),
    )
    return lines + [
        Text(f"  {what:<11}{', '.join(names)}") for what, names in known if names and offers
    ]


def journal_table(journal: StoreJournal) -> Table:
    """One line a change."""
    rows = []
    for entry in journal.entries:
        at, value = _journal_at(entry)
        rows.append((entry.number, at, entry.keyexpr, value))
    return table(["number", "at", "key", "value"], rows)


def journal_line(entry: JournalEntry) -> str:
    """A change while one looks on."""
    at, value = _journal_at(entry)
    return f"{entry.number}  {at}  {entry.keyexpr}  {value}"


def _journal_at(entry: JournalEntry) -> tuple[str, str]:
    """When it was applied, with the day if that is not today; and the value, cut."""
    time = datetime.fromtimestamp(entry.wall_time_s)
    day = "" if time.date() == datetime.now().date() else time.strftime("%Y-%m-%d ")
    value = "deleted" if entry.deleted else entry.value or ""
    return day + time.strftime("%H:%M:%S.%f")[:-3], value[:VALUE_WIDTH]
