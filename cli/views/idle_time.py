"""Idle time of a plan's robots, as a table."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.text import Text

from cli.plans.idle import IdleReport
from cli.views.console import table
from cli.views.text import seconds


def idle_page(report: IdleReport) -> RenderableType:
    """One line a robot, one for all, and the makespan beside its lower bound."""
    heading = Text("Idle time", "bold")
    columns = (
        ("of real durations, predicted", report.predicted, seconds),
        ("measured", report.measured, seconds),
        ("of unit tasks, predicted", report.unit_predicted, _steps),
        ("measured", report.unit_measured, _steps),
    )
    there = [(name, found, length) for name, found, length in columns if found is not None]
    if not there:
        return Group(heading, "no robots are allocated yet")
    robots = dict.fromkeys([*report.fleet, *(r for _, found, _ in there for r in found.idle)])
    rows = [
        *((robot, *(_share(found.idle.get(robot)) for _, found, _ in there)) for robot in robots),
        ("mean", *(_share(found.mean) for _, found, _ in there)),
        ("makespan", *(length(found.makespan) for _, found, length in there)),
    ]
    names = [name for name, _, _ in there]
    return Group(heading, table(["robot", *names], rows), *map(Text, _lines(report)))


def _lines(report: IdleReport) -> list[str]:
    lines = [
        "real durations: over every registered robot that has a skill of the plan",
        "unit tasks: every task a step, only robots that have tasks (0 % if one does everything)",
    ]
    if report.over_bound is not None:
        bound = f"lower bound of this task graph ({seconds(report.lower_bound_s)})"
        ratio = f"makespan ÷ {bound}: {report.over_bound:.3f} predicted"
        if report.measured_over_bound is not None:
            ratio += f", {report.measured_over_bound:.3f} measured"
        lines.append(ratio)
    else:
        lines.append("the allocator gave no lower bound of this task graph; `makespan` does")
    if report.measured is not None and not report.ended:
        lines.append("the plan has not ended: measured is up to the last task that has")
    return lines


def _share(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def _steps(makespan: float) -> str:
    return f"{makespan:.0f} steps"
