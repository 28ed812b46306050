"""Curves over the number of tasks, a line for each number of robots; what was before is dashed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

Rows = list[dict[str, Any]]


def draw(path: Path, now: dict[str, Any], before: dict[str, Any]) -> None:
    """Tasks a second, an event, taking a plan over, goals told: as far as there are results."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(12, 8.4), layout="constrained")
    core = _rows(now, "core"), _rows(before, "core")
    _curves(axes[0][0], *core, lambda row: row["tasks_a_second"])
    axes[0][0].set_title("tasks a second through step alone")
    _curves(axes[0][1], *core, lambda row: row["succeeded_ms"]["p50"])
    axes[0][1].set_title("a task ends: p50 of the event [ms of CPU]")
    _curves(axes[1][0], *core, lambda row: row["taken_over_s"])
    axes[1][0].set_title("a plan is taken over: one event [s of CPU]")
    _goals(axes[1][1], _rows(now, "goals"), _rows(before, "goals"))
    axes[1][1].set_title("goals told, all together [s]")
    for axis in axes.flat:
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel("goals" if axis is axes[1][1] else "tasks")
        axis.spines[["top", "right"]].set_visible(False)
        if axis.get_legend_handles_labels()[0]:
            axis.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _rows(parts: dict[str, Any], part: str) -> Rows:
    return parts[part]["results"] if part in parts else []


def _curves(axis: Any, now: Rows, before: Rows, of: Callable[[dict[str, Any]], float]) -> None:
    numbers = list(dict.fromkeys(row["robots"] for row in (*now, *before)))
    for rows, dashes, when in ((before, "--", ", before"), (now, "-", "")):
        for place, robots in enumerate(numbers):
            some = [row for row in rows if row["robots"] == robots and _has(row, of)]
            if some:
                axis.plot(
                    [row["tasks"] for row in some],
                    [of(row) for row in some],
                    dashes,
                    marker="." if when else "o",
                    color=f"C{place}",
                    alpha=0.6 if when else 1.0,
                    label=f"{robots:,} robots{when}",
                )


def _has(row: dict[str, Any], of: Callable[[dict[str, Any]], float]) -> bool:
    """A run that was cut off at once has no event of every kind."""
    try:
        return of(row) > 0
    except KeyError:
        return False


def _goals(axis: Any, now: Rows, before: Rows) -> None:
    for rows, dashes, when in ((before, "--", ", before"), (now, "-", "")):
        for place, way in enumerate(dict.fromkeys(row["way"] for row in rows)):
            some = [row for row in rows if row["way"] == way and row["told"] == row["goals"]]
            axis.plot(
                [row["goals"] for row in some],
                [row["took_s"] for row in some],
                dashes,
                marker="." if when else "o",
                color=f"C{place}",
                alpha=0.6 if when else 1.0,
                label=f"{way}{when}",
            )
