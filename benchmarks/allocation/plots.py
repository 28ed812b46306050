"""Plots of the allocation benchmarks."""

from __future__ import annotations

from pathlib import Path
from statistics import mean, stdev
from typing import Any

from benchmarks.allocation.bench_household import PAPER
from benchmarks.allocation.household import REAL, STRATEGIES, scenarios


def draw(folder: Path, parts: dict[str, Any]) -> dict[str, tuple[str, str]]:
    """Draw what there are results of: by part, the file and what it shows."""
    import matplotlib

    matplotlib.use("Agg")
    drawn: dict[str, tuple[str, str]] = {}
    for part, run, name, about in (
        ("household", _households, "allocation-idle.png", "Idle time of the fleet"),
        ("sizes", _sizes, "allocation-sizes.png", "Makespan by lower bound, by size"),
        (
            "rescheduling",
            _rescheduling,
            "allocation-rescheduling.png",
            "Moves and makespan after a loss",
        ),
    ):
        if part in parts:
            run(parts[part]["results"], folder / name)
            drawn[part] = (name, about)
    return drawn


def _households(results: list[dict[str, Any]], path: Path) -> None:
    import matplotlib.pyplot as plt

    names = list(dict.fromkeys(row["allocator"] for row in results))
    figure, axes = plt.subplots(1, 2, figsize=(12, 4.6), sharey=True, layout="constrained")
    for axis, scenario in zip(axes, scenarios(), strict=True):
        for number, name in enumerate(names):
            for place, strategy in enumerate(STRATEGIES):
                some = [
                    row
                    for row in results
                    if row["clock"] == REAL
                    and (row["scenario"], row["allocator"], row["strategy"])
                    == (scenario, name, strategy)
                ]
                shares = [100 * row["fleet_idle"] for row in some]
                least = mean(100 * row["least_idle"] for row in some)
                x = place + 0.8 * (number + 0.5) / len(names) - 0.4
                axis.bar(
                    x,
                    mean(shares),
                    0.8 / len(names) * 0.92,
                    yerr=stdev(shares) if len(shares) > 1 else 0.0,
                    color=f"C{number}",
                    error_kw={"elinewidth": 0.8, "capsize": 2},
                    label=name if place == 0 else None,
                )
                if number == 0:
                    axis.hlines(
                        least,
                        place - 0.42,
                        place + 0.42,
                        color="black",
                        label="least there" if place == 0 else None,
                    )
        axis.axhline(
            100 * PAPER[scenario],
            color="grey",
            linestyle=":",
            label="paper's best (its definition, its graphs)",
        )
        axis.set_xticks(range(len(STRATEGIES)), STRATEGIES)
        axis.set_title(scenario)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("idle time of the fleet, real durations [%]")
    axes[0].set_ylim(bottom=0)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _sizes(results: list[dict[str, Any]], path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(12, 4.4), layout="constrained")
    names = list(dict.fromkeys(name for row in results for name in row["makespan_s"]))
    for axis, travel in zip(axes, (False, True), strict=True):
        mine = [row for row in results if row["travel"] is travel]
        for number, name in enumerate(names):
            some = [row for row in mine if name in row["makespan_s"]]
            if not some:
                continue
            axis.plot(
                [row["tasks"] for row in some],
                [row["makespan_s"][name] / row["bound_s"] for row in some],
                marker="o" if name.startswith("makespan") else ".",
                linewidth=2 if name.startswith("makespan") else 1,
                linestyle="-" if name.startswith(("makespan", "list")) else "--",
                color=f"C{number}",
                label=name,
            )
        axis.axhline(1.0, color="black", linewidth=0.8)
        axis.set_xscale("log")
        axis.set_xlabel("tasks")
        axis.set_title("with travel: the bound is loose" if travel else "without travel")
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("makespan ÷ proven lower bound")
    entries = {
        label: handle
        for axis in axes
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        entries.values(), entries.keys(), loc="outside lower center", ncols=4, frameon=False
    )
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _rescheduling(results: list[dict[str, Any]], path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(8, 3.6), layout="constrained")
    labels = []
    for place, row in enumerate(results):
        travel = "travel" if row["travel"] else "no travel"
        labels.append(f"{row['what']}, {travel}")
        for shift, moves, after_s, color, label in (
            (-0.2, row["moved"], row["after_s"], "C0", "rescheduled"),
            (0.2, row["scratch_moved"], row["scratch_s"], "C1", "from scratch"),
        ):
            axis.bar(place + shift, moves, 0.38, color=color, label=None if place else label)
            axis.annotate(
                f"{after_s:.0f} s", (place + shift, moves), ha="center", va="bottom", fontsize=8
            )
    axis.set_xticks(range(len(labels)), labels)
    axis.set_ylabel("blocks that changed hands, of 1,000 tasks")
    axis.set_title("one of 50 robots; above the bars the makespan", fontsize=10)
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=130)
    plt.close(figure)
