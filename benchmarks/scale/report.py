"""The page: what was to be reached, before and now, and every measurement."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.scale import plots
from benchmarks.scale.targets import ROWS
from benchmarks.tables import as_markdown
from keyexpr_schema.yaml_reader import read_yaml

Row = dict[str, Any]
Column = tuple[str, Callable[[Row], str]]


def _number(name: str, form: str = ",.0f", unit: str = "") -> Column:
    """A column with the number of this name; nothing where a row has none."""

    def cell(row: Row) -> str:
        value = row.get(name)
        return "" if value is None else f"{value:{form}}{unit}"

    return name.replace("_", " "), cell


def _of_cpu(row: Row) -> str:
    """What there would be with nothing else on the machine, and one core."""
    had_s = [row.get(f"{name}_cpu_s") for name in PROCESSES]
    return "" if None in had_s else f"{row['done'] / sum(filter(None, had_s)):,.0f}"


def _finished(row: Row) -> str:
    if row["finished"]:
        return "yes"
    return f"not finished in {row['worked_s']:.0f} s, {row['done']:,} tasks done"


def _ms(name: str, title: str) -> tuple[Column, Column]:
    return tuple(
        (
            f"{title}, {mark}",
            lambda row, mark=mark: f"{row[name][mark]:.2f} ms" if name in row else "",
        )
        for mark in ("p50", "p99")
    )  # type: ignore[return-value]


PROCESSES = ("planner", "router", "robots")
_SIZE = (_number("robots"), _number("tasks"))
_PLANNED = ("until the first order", lambda row: f"{row['planned_s']:.1f} s")
LIFETIME: Sequence[Column] = (
    ("missions", lambda row: row["missions"]),
    ("a mission takes", lambda row: f"{row['took_s']:.2f} s"),
    ("the longest", lambda row: f"{row['worst_s']:.2f} s"),
    _number("restarts"),
    _number("planner_ready_s", ".2f", " s"),
    _number("planner_ready_cpu_s", ".2f", " s"),
    *(
        (f"CPU of a mission, {name}", lambda row, name=name: f"{row['cpu_s'][name]:.2f} s")
        for name in ("planner", "router", "workers")
    ),
    *(
        (f"RSS, {name}", lambda row, name=name: f"{row['rss_mb'][name]:.0f} MB")
        for name in ("planner", "router", "workers")
    ),
    *(
        (f"files, {name}", lambda row, name=name: f"{row['files_mb'][name]:.1f} MB")
        for name in ("planner", "history", "store", "workers")
    ),
    ("load average", lambda row: f"{row['load']:.1f}"),
)
COLUMNS: dict[str, Sequence[Column]] = {
    "core": (
        *_SIZE,
        ("taken over", lambda row: f"{row['taken_over_s']:.3f} s"),
        ("tasks a second", lambda row: f"{row['tasks_a_second']:,.0f}"),
        ("to the end", _finished),
        *_ms("started_ms", "a task starts"),
        *_ms("succeeded_ms", "a task ends"),
        *_ms("unchanged_ms", "nothing changes"),
    ),
    "events": (
        *_SIZE,
        ("ended plans behind it", lambda row: f"{row['ended']}"),
        ("a task starts", lambda row: f"{row['task_started_ms']:.3f} ms"),
        ("a task ends", lambda row: f"{row['task_ended_ms']:.3f} ms"),
        ("a goal is told", lambda row: f"{row['goal_ms']:.3f} ms" if "goal_ms" in row else ""),
        (
            "as a sentence",
            lambda row: f"{row['sentence_ms']:.3f} ms" if "sentence_ms" in row else "",
        ),
        ("a report again", lambda row: f"{row['said_again_ms']:.3f} ms"),
        ("own fact comes back", lambda row: f"{row['own_fact_ms']:.3f} ms"),
        ("a timer", lambda row: f"{row['timer_ms']:.3f} ms"),
    ),
    "goals": (
        ("way", lambda row: row["way"]),
        _number("goals"),
        ("told in", lambda row: f"{row['took_s']:.3f} s"),
        (
            "to the end",
            lambda row: "yes" if row["told"] == row["goals"] else f"no, {row['told']:,} told",
        ),
        _number("planner_cpu_s", ".2f", " s"),
    ),
    "keys": (
        *_SIZE,
        _PLANNED,
        ("tasks a second", lambda row: f"{row['tasks_a_second']:,.0f}"),
        ("to the end", _finished),
        _number("planner_cpu_s", ".1f", " s"),
        _number("router_cpu_s", ".1f", " s"),
        _number("robots_cpu_s", ".1f", " s"),
        ("tasks a second of all CPU", _of_cpu),
        _number("planner_rss_mb", ".0f", " MB"),
    ),
    "dispatch": (
        ("while another plan is made", lambda row: "yes" if row["planning"] else "no"),
        _number("plans_made"),
        *_SIZE,
        _number("orders"),
        *_ms("order_ms", "report put to order"),
        *_ms("raw_ms", "Zenoh alone"),
        ("p50 ÷ Zenoh's", lambda row: f"{row['order_ms']['p50'] / row['raw_ms']['p50']:.1f}"),
        ("p99 ÷ Zenoh's", lambda row: f"{row['order_ms']['p99'] / row['raw_ms']['p99']:.1f}"),
    ),
    "writes": (
        ("what", lambda row: row["what"]),
        *_ms("ms", "latency"),
        ("a second, best", lambda row: f"{row['a_second']:,.0f}" if "a_second" in row else ""),
        ("each round", lambda row: ", ".join(f"{rate:,.0f}" for rate in row.get("rounds", ()))),
    ),
    "restart": (
        ("what the planner has behind it", lambda row: f"{row['number']:,} {row['what']}"),
        (
            "ready after",
            lambda row: "not in 60 s" if row["ready_s"] is None else f"{row['ready_s']:.2f} s",
        ),
        _number("cpu_s", ".2f", " s"),
        _number("rss_mb", ".0f", " MB"),
        _number("store_mb", ".1f", " MB"),
        _number("journal_mb", ".1f", " MB"),
    ),
    "idle": (
        ("process", lambda row: row["process"]),
        _number("reports"),
        _number("robots"),
        ("of a core", lambda row: f"{100 * row['share_of_core']:.2f} %"),
        _number("rss_mb", ".0f", " MB"),
    ),
    "physics": (
        _number("robots"),
        _number("worker_processes"),
        ("times real time", lambda row: f"{row['times_real_time']:.2f}"),
        ("simulated in", lambda row: f"{row['simulated_s']:.0f} s in {row['took_s']:.0f} s"),
        (
            "cores had: simulation, workers, planner, router",
            lambda row: ", ".join(
                f"{row['cpu_s'][name] / row['took_s']:.2f}"
                for name in ("sim", "workers", "planner", "router")
            ),
        ),
        (
            "simulated s ÷ s of CPU, all",
            lambda row: f"{row['simulated_s'] / sum(row['cpu_s'].values()):.2f}",
        ),
        _number("running_at_the_end"),
        _number("succeeded"),
    ),
    "lifetime": LIFETIME,
    "operators": LIFETIME,
    "missions": (
        ("missions", lambda row: row["missions"]),
        _number("cpu_ms", ".2f", " ms"),
        ("state", lambda row: f"{row['state_bytes'] / 1024:.1f} kB"),
        _number("keys"),
        _number("deletions"),
        ("entries, store's journal", lambda row: f"{row['store_journal']:,}"),
        ("events, planner's journal", lambda row: f"{row['planner_journal']:,}"),
        *(
            (f"files, {name}", lambda row, name=name: f"{row[f'{name}_mb']:.1f} MB")
            for name in ("store", "planner", "history")
        ),
        _number("rss_mb", ".0f", " MB"),
        ("started again in", lambda row: f"{row['started_s']:.2f} s"),
    ),
    "recording": (
        ("after", lambda row: f"{row['after_s']:.0f} s"),
        ("recorder", lambda row: "no" if row.get("without") else "yes"),
        _number("missions"),
        ("missions a second", lambda row: f"{row['missions'] / row['after_s']:.1f}"),
        _number("cpu_s", ".1f", " s"),
        _number("rss_mb", ".0f", " MB"),
        _number("files"),
        _number("files_mb", ".1f", " MB"),
        ("load average", lambda row: f"{row['load']:.1f}" if "load" in row else ""),
    ),
}


def show(part: str, about: dict[str, Any], console: Console) -> None:
    """Print a part."""
    table = Table(*(title for title, _ in COLUMNS[part]), title=part)
    for row in about["results"]:
        table.add_row(*(cell(row) for _, cell in COLUMNS[part]))
    console.print(table)


def write(folder: Path) -> None:
    """scale.md and its curves, from all parts that there are in the data beside them."""
    now, before = (_read(folder / name) for name in ("scale.json", "scale-before.json"))
    texts = _texts()
    plots.draw(folder / "scale.png", now, before)
    parts = [texts.pop("head"), _summary(now, before), "![Curves](scale.png)"]
    for part, text in texts.items():
        if part not in now and part not in before:
            continue
        parts.append(text)
        for title, about in (("Now", now.get(part)), ("Before", before.get(part))):
            if about is not None:
                parts.append(
                    f"**{title}**\n\n{_table(part, about)}\n\n{_in_all(about)}{_how(about)}"
                )
    page = "\n\n".join(text.strip() for text in parts) + "\n"
    (folder / "scale.md").write_text(page, encoding="utf-8")


def _summary(now: dict[str, Any], before: dict[str, Any]) -> str:
    rows = [
        (
            row.what,
            row.to_reach,
            row.measured(before),
            row.load(before),
            row.measured(now),
            row.load(now),
        )
        for row in ROWS
    ]
    return as_markdown(("what", "to reach", "before", "at load", "now", "at load"), rows)


def _table(part: str, about: dict[str, Any]) -> str:
    used = [column for column in COLUMNS[part] if any(column[1](row) for row in about["results"])]
    rows = [tuple(cell(row) for _, cell in used) for row in about["results"]]
    return as_markdown([title for title, _ in used], rows)


def _in_all(about: dict[str, Any]) -> str:
    """What stands with the last row about all of them, in sentences."""
    row = about["results"][-1]
    if "actions" not in row:
        return ""
    goals, did, why = (_counted(row[name]) for name in ("goals", "actions", "reasons"))
    grew = ", ".join(f"{name} {each:+.1f} %" for name, each in row["growth_percent"].items())
    wrong = "; ".join(row["wrong"]) or "nothing"
    return (
        f"Goals: {goals}. Why they failed: {why or 'none did'}. Done: {did}. "
        f"Tasks: {row['tasks']:,}, done twice: {row['twice']}. Wrong: {wrong}. "
        f"Growth in a hundred missions: {grew}.\n\n"
    )


def _counted(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())


def _how(about: dict[str, Any]) -> str:
    return (
        f"`{about['command']}` at commit {about['commit']}: {about['took_s']:.0f} s on "
        f"{about['machine']}; load average {about['load_before']} before, "
        f"{about['load_after']} after."
    )


def _read(file: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    return found


def _texts() -> dict[str, str]:
    """page.yaml: by part, and the head of the page."""
    found: dict[str, str] = read_yaml(Path(__file__).with_name("page.yaml"), ValueError)
    return found
