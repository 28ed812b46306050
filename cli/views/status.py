"""The fleet on one page, and the store's journal."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from cli.client.holds import in_words
from cli.views.console import table
from cli.views.goals import GoalRow, goals_table
from cli.views.plans import plans_table
from cli.views.robots import RobotRow, robots_table
from cli.views.schedules import next_lines
from keyexpr_schema.payloads.stops import Stop
from keyexpr_schema.payloads.system import (
    Diagnostic,
    JournalEntry,
    PlannerStatus,
    StoreJournal,
    UndecodableValue,
)

if TYPE_CHECKING:
    from cli.client.fleet_view import FleetView

VALUE_WIDTH = 120
"""Characters of a value shown in the journal; `--json` shows all of it."""


def status_page(
    routers: Sequence[str],
    realm: str,
    planner: PlannerStatus | None,
    planning: bool,
    robots: Sequence[RobotRow],
    goals: Sequence[GoalRow],
    view: FleetView,
    diagnostics: Sequence[Diagnostic],
    undecodable: Sequence[UndecodableValue],
) -> Group:
    """One page; a part with nothing in it is one short line."""
    plans = set(view.plans) | set(view.plan_status)
    unreadable: list[RenderableType] = ["", undecodable_table(undecodable)] if undecodable else []
    return Group(
        f"router   {', '.join(routers)}, realm {realm}",
        f"planner  {_planner(planner, planning)}",
        *(_diagnostic(each) for each in diagnostics),
        *(_stop(stop, view) for _, stop in sorted(view.stops.items())),
        *(Text(in_words(hold), style="yellow") for _, hold in sorted(view.holds.items())),
        *(Text(str(closure), style="yellow") for closure in view.standing_closures()),
        *next_lines(view.schedule_status.values()),
        "",
        robots_table(robots) if robots else "No robots are registered.",
        "",
        goals_table(goals) if goals else "No goals.",
        "",
        plans_table(view.plans, view.plan_status) if plans else "No plans.",
        *unreadable,
    )


def _planner(planner: PlannerStatus | None, planning: bool) -> str:
    if not planning:
        return "not running (start one with `robotctl planner`)"
    if planner is None:
        return "running"
    offers = (
        ("strategies", planner.strategies),
        ("planners", planner.planners),
        ("allocators", planner.allocators),
        ("skills", planner.skills),
    )
    lines = [f"  {what:<11}{', '.join(names)}" for what, names in offers if names]
    return "\n".join([f"running, epoch {planner.epoch}", *lines])


def _diagnostic(found: Diagnostic) -> Text:
    since = datetime.fromtimestamp(found.since_s).strftime("%Y-%m-%d %H:%M:%S")
    often = f", {found.count} times" if found.count > 1 else ""
    return Text(f"{found.component}: {found.sentence} (since {since}{often})", style="red")


def _stop(stop: Stop, view: FleetView) -> Text:
    """Whom an emergency stop holds, and who of them has not said that it rests."""
    held = view.held_by(stop)
    whom = ", ".join(held) if stop.robots or not held else f"all robots ({', '.join(held)})"
    silent = [
        robot
        for robot in held
        if robot not in view.robot_states or stop.stop not in view.robot_states[robot].stops
    ]
    missing = f"; NOT CONFIRMED by {', '.join(silent)}" if silent else ""
    return Text(f"{stop} holds {whom or 'nobody'}{missing}", style="bold red")


def undecodable_table(undecodable: Sequence[UndecodableValue]) -> Table:
    """One line a value that somebody could not read."""
    return table(
        ["key", "reported by", "times", "reason"],
        ((v.keyexpr, v.component, v.count, v.reason) for v in undecodable),
        title="Unreadable values",
    )


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
