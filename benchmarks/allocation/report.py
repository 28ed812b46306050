"""Tables, plots and the page of the allocation benchmarks."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import mean
from typing import Any

from rich.console import Console

from benchmarks.allocation import bench_household, bench_makespan, plots
from benchmarks.allocation.household import REAL, UNIT, scenarios
from benchmarks.tables import as_markdown
from keyexpr_schema.yaml_reader import read_yaml

Rows = bench_makespan.Rows


def tables(part: str, results: Any) -> list[tuple[str, Rows]]:
    """The tables of a part, each with its title."""
    if part == "household":
        runs = [bench_household.Run(**row) for row in results]
        return [
            (
                f"{scenario} (the paper's best: {100 * bench_household.PAPER[scenario]:.1f} %)",
                (bench_household.HEAD, bench_household.rows(runs, scenario)),
            )
            for scenario in scenarios()
        ]
    if part == "sizes":
        found = [bench_makespan.Size(**row) for row in results]
        return [("Makespan ÷ proven lower bound (time)", bench_makespan.size_rows(found))]
    if part == "coalitions":
        return [("8 tasks, 3 robots, coalitions", _coalition_rows(results))]
    if part == "public":
        found_public = [bench_makespan.Public(**row) for row in results]
        return [("Public instances", bench_makespan.public_rows(found_public))]
    if part == "rescheduling":
        repaired = [bench_makespan.Rescheduling(**row) for row in results]
        return [("One of 50 robots, 1,000 tasks", bench_makespan.rescheduling_rows(repaired))]
    return [("balanced: 10,000 tasks, 1,000 robots", _balanced_rows(results))]


def _coalition_rows(results: Sequence[Sequence[float]]) -> Rows:
    proven = sum(gap < 1e-4 for gap, _ in results)
    took = [took_s for _, took_s in results]
    return ("shops", "proven optimal", "took, mean", "took, worst"), [
        (str(len(results)), str(proven), f"{mean(took):.2f} s", f"{max(took):.2f} s")
    ]


def _balanced_rows(results: Sequence[dict[str, Any]]) -> Rows:
    return ("robots", "time", "memory", "loads: most, least", "proven"), [
        (
            row["kind"],
            f"{row['s']:.2f} s",
            f"{row['mb']:.0f} MB",
            f"{row['most']}, {row['least']}",
            "yes" if row["proven"] else "no",
        )
        for row in results
    ]


def show(part: str, measured: dict[str, Any], console: Console) -> None:
    """Print a part."""
    for title, rows in tables(part, measured["results"]):
        console.print(bench_makespan.as_table(title, rows))


def points_over_bound(results: Sequence[dict[str, Any]], strategy: str, scenario: str) -> float:
    """How many points more of the fleet is idle with `makespan` than at the bound, on average."""
    some = [
        bench_household.Run(**row)
        for row in results
        if row["allocator"] == "makespan"
        and row["clock"] == REAL
        and (row["strategy"], row["scenario"]) == (strategy, scenario)
    ]
    return 100 * mean(run.fleet_idle - run.least_idle for run in some)


def best_by_reference(results: Sequence[dict[str, Any]], scenario: str) -> tuple[float, str]:
    """The least mean idle time by the reference's definition, and who has it."""
    found: dict[str, list[float]] = {}
    for row in results:
        if row["scenario"] == scenario and row["clock"] == UNIT:
            name = f"{row['strategy']}, {row['allocator']}"
            found.setdefault(name, []).append(row["unit_idle"])
    name = min(found, key=lambda key: mean(found[key]))
    return 100 * mean(found[name]), name


def write(folder: Path, measured: dict[str, Any]) -> None:
    """allocation.md with its plots, from all parts that there are."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = plots.draw(folder, measured)
    texts = _texts()
    parts = [texts.pop("head").format(packages=_packages())]
    for part, text in texts.items():
        if part not in measured:
            continue
        parts.append(text.format(**_facts(part, measured[part]["results"])))
        if part in drawn:
            parts.append(f"![{drawn[part][1]}]({drawn[part][0]})")
        for title, rows in tables(part, measured[part]["results"]):
            parts.append(f"**{title}**\n\n{as_markdown(rows[0], rows[1])}")
        about = measured[part]
        parts.append(
            f"`{about['command']}`: {about['took_s']:.0f} s on {about['machine']}; "
            f"load average before it began: {about['load_before']}."
        )
    text = "\n\n".join(parts) + "\n"
    (folder / "allocation.md").write_text(text, encoding="utf-8")


def _packages() -> str:
    found = []
    for name in ("ortools", "pulp", "scipy"):
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"no {name}")
    return ", ".join(found)


def _facts(part: str, results: Any) -> dict[str, str]:
    if part != "household":
        return {}
    lines = []
    for scenario in scenarios():
        best, name = best_by_reference(results, scenario)
        over = ", ".join(
            f"{strategy} {points_over_bound(results, strategy, scenario):.1f}"
            for strategy in dict.fromkeys(row["strategy"] for row in results)
        )
        lines.append(
            f"- *{scenario}*: by the reference's definition the least mean is {best:.1f} % "
            f"({name}), the paper's {100 * bench_household.PAPER[scenario]:.1f} %. With `makespan` "
            "and real "
            f"durations the fleet is idle for so many points more than at the bound: {over}."
        )
    seeds = len({row["seed"] for row in results})
    return {"summary": "\n".join(lines), "seeds": str(seeds)}


def _texts() -> dict[str, str]:
    """page.yaml: by part, and the head of the page."""
    found: dict[str, str] = read_yaml(Path(__file__).with_name("page.yaml"), ValueError)
    return found
