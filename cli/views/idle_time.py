"""Idle time of a plan's robots, as a table."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.text import Text

from cli.plans.idle import Idle, IdleReport
from cli.views.console import table
from cli.views.text import seconds


def idle_page(report: IdleReport) -> RenderableType:
    """One line a robot, one for all, and the makespan beside its lower bound."""
    heading = Text("Idle time", "bold")
    columns = {
        "of real durations, predicted": report.predicted,
        "measured": report.measured,
        "of unit tasks, predicted": report.unit_predicted,
        "measured ": report.unit_measured,
    }
    there = {name: found for name, found in columns.items() if found is not None}
    if not there:
        return Group(heading, "no robots are allocated yet")
    robots = dict.fromkeys([*report.fleet, *(r for found in there.values() for r in found.idle)])
    rows = [
        *(
            (robot, *(_share(found.idle.get(robot)) for found in there.values()))
            for robot in robots
        ),
        ("mean", *(_share(found.mean) for found in there.values())),
        ("makespan", *(_length(name, found) for name, found in there.items())),
    ]
    return Group(heading, table(["robot", *there], rows), *map(Text, _lines(report)))


def _lines(report: IdleReport) -> list[str]:
    lines = [
        "real durations: over every registered robot that has a skill of the plan",
        "unit tasks: every task a step, only robots that have tasks (0 % if one does everything)",
    ]
    if report.over_bound is not None:
        bound = f"lower bound ({seconds(report.lower_bound_s)})"
        ratio = f"makespan ÷ {bound}: {report.over_bound:.3f} predicted"
        if report.measured_over_bound is not None:
            ratio += f", {report.measured_over_bound:.3f} measured"
        lines.append(ratio)
    else:
        lines.append("the allocator gave no lower bound of the makespan; `makespan` does")
    if report.measured is not None and not report.ended:
        lines.append("the plan has not ended: measured is up to the last task that has")
    return lines


def _share(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def _length(name: str, found: Idle) -> str:
    unit = "unit" in name or name.endswith(" ")
    return f"{found.makespan:.0f} steps" if unit else seconds(found.makespan)
