"""What was to be reached, and where in the measurements it is found."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

Rows = list[dict[str, Any]]
NOTHING = "-"


@dataclass(frozen=True)
class Target:
    """One row of the first table; `found` says in words what the rows of `part` came to."""

    what: str
    to_reach: str
    part: str
    found: Callable[[Rows], str]

    def measured(self, parts: dict[str, Any]) -> str:
        """What was measured, or a dash."""
        if self.part not in parts:
            return NOTHING
        return self.found(parts[self.part]["results"])

    def load(self, parts: dict[str, Any]) -> str:
        """The load average before and after."""
        about = parts.get(self.part)
        return f"{about['load_before']}, {about['load_after']}" if about else NOTHING


def _where(rows: Rows, **fields: Any) -> Iterator[dict[str, Any]]:
    return (row for row in rows if all(row.get(name) == value for name, value in fields.items()))


def _first(rows: Rows, say: Callable[[dict[str, Any]], str], **fields: Any) -> str:
    row = next(_where(rows, **fields), None)
    return NOTHING if row is None else say(row)


def _tasks_a_second(rows: Rows) -> str:
    def say(row: dict[str, Any]) -> str:
        rate = f"{row['tasks_a_second']:,.0f}"
        return rate if row["finished"] else f"{rate} (of {row['done']:,}, then cut off)"

    sizes = ((50, 1000), (50, 10_000), (1000, 10_000))
    return " · ".join(_first(rows, say, robots=robots, tasks=tasks) for robots, tasks in sizes)


_CHANGING = ("task_started_ms", "task_ended_ms")
_UNCHANGING = ("said_again_ms", "own_fact_ms", "timer_ms")


def _most(rows: Rows, names: tuple[str, ...], **fields: Any) -> str:
    found = [row[name] for row in _where(rows, **fields) for name in names]
    return f"{max(found):.3f}" if found else NOTHING


def _events(rows: Rows) -> str:
    return f"{_most(rows, _CHANGING, tasks=1000)} · {_most(rows, _CHANGING, tasks=10_000)} ms"


def _spread(rows: Rows) -> str:
    factors = [max(found) / min(found) for name in _CHANGING if (found := [r[name] for r in rows])]
    return f"{max(factors):.1f}" if factors else NOTHING


def _unchanged(rows: Rows) -> str:
    return f"{_most(rows, _UNCHANGING)} ms"


def _taken_over(rows: Rows) -> str:
    return _first(rows, lambda row: f"{row['taken_over_s']:.2f} s", robots=1000, tasks=10_000)


def _dispatch(planning: bool) -> Callable[[Rows], str]:
    def say(row: dict[str, Any]) -> str:
        order, raw = row["order_ms"], row["raw_ms"]
        return (
            f"p50 {order['p50']:.1f}, p99 {order['p99']:.1f} ms; "
            f"p50 {order['p50'] / raw['p50']:.1f} x Zenoh's {raw['p50']:.2f}"
        )

    return lambda rows: _first(rows, say, planning=planning)


def _goals(way: str) -> Callable[[Rows], str]:
    def found(rows: Rows) -> str:
        some = [row for row in _where(rows, way=way) if row["goals"] >= 1000]
        return " · ".join(
            f"{row['took_s']:.2f} s"
            if row["told"] == row["goals"]
            else f"cut off at {row['told']:,}"
            for row in some
        )

    return found


def _ready(rows: Rows) -> str:
    some = list(_where(rows, what="missions lived"))
    return " · ".join(
        f"{row['number']}: {'not in 60 s' if row['ready_s'] is None else _seconds(row)}"
        for row in some
    )


def _seconds(row: dict[str, Any]) -> str:
    cpu_s = row.get("cpu_s")
    return f"{row['ready_s']:.2f} s" + (f" ({cpu_s:.2f} s CPU)" if cpu_s else "")


def _full(rows: Rows) -> str:
    return _first(
        rows,
        lambda row: "not in 60 s" if row["ready_s"] is None else _seconds(row),
        what="reports in the store",
    )


def _share(row: dict[str, Any]) -> str:
    return f"{100 * row['share_of_core']:.2f} %"


def _idle_planner(rows: Rows) -> str:
    stored = [row for row in rows if row.get("reports")]
    return (
        " (router ".join(_first(stored, _share, process=name) for name in ("planner", "router"))
        + ")"
    )


def _idle_workers(rows: Rows) -> str:
    said = []
    for robots in dict.fromkeys(row["robots"] for row in rows if row.get("robots")):
        shares = [
            row["share_of_core"]
            for row in _where(rows, robots=robots)
            if row["process"].startswith("worker")
        ]
        said.append(
            f"{_counted(robots, 'robot')}, {_counted(len(shares), 'process')}: "
            f"{100 * sum(shares) / robots:.2f} % each"
        )
    return "; ".join(said) or NOTHING


def _counted(number: int, thing: str) -> str:
    many = f"{thing}es" if thing.endswith("s") else f"{thing}s"
    return f"{number} {thing if number == 1 else many}"


def _physics(rows: Rows) -> str:
    return _first(rows, lambda row: f"{row['times_real_time']:.2f} x", robots=50)


def _writes(rows: Rows) -> str:
    together = _first(
        rows, lambda row: f"{row['a_second']:,.0f}/s", what="confirmed writes, 64 at once"
    )
    single = _first(rows, lambda row: f"p99 {row['ms']['p99']:.2f} ms", what="confirmed write")
    return f"{together}; {single}"


def _lifetime(rows: Rows) -> str:
    def say(row: dict[str, Any]) -> str:
        memory = sum(row["rss_mb"][name] for name in ("planner", "router", "workers"))
        files = sum(row["files_mb"][name] for name in ("planner", "store", "workers"))
        return (
            f"missions {row['missions']}: {row['took_s']:.2f} s each, {memory:.0f} MB, "
            f"files {files:.0f} MB"
        )

    return "; ".join(say(rows[place]) for place in (0, len(rows) // 2, -1)) if rows else NOTHING


def _operators(rows: Rows) -> str:
    last = rows[-1]
    goals = ", ".join(f"{count} {state}" for state, count in sorted(last["goals"].items()))
    steepest, percent = max(last["growth_percent"].items(), key=lambda each: each[1])
    return (
        f"{goals}; {last['tasks']:,} tasks, {last['twice']} done twice; "
        f"{len(last['wrong'])} things wrong; grows most: {steepest}, {percent:+.1f} % in 100"
    )


def _recorder(rows: Rows) -> str:
    first, last = next(row for row in rows if not row.get("without")), rows[-1]
    return (
        f"{last['cpu_s']:.0f} s CPU in {last['after_s']:.0f} s, "
        f"RSS {first['rss_mb']:.0f} to {last['rss_mb']:.0f} MB, {last['missions']} missions"
    )


ROWS = (
    Target("tasks a second through `step` alone: 50 robots x 1,000 tasks · 50 x 10,000 · "
           "1,000 x 10,000", "as below", "core", _tasks_a_second),
    Target("tasks a second from end to end over Zenoh: 50 x 1,000 · 50 x 10,000 · "
           "1,000 x 10,000", "≥ 500 · ≥ 500 · ≥ 300, to the end", "keys", _tasks_a_second),
    Target("an event of a running plan of 1,000 · 10,000 tasks (`step` alone, the dearest)",
           "≤ 0.5 ms", "events", _events),
    Target("the same, from 100 to 10,000 tasks, 2 to 1,000 robots, 1 to 100 ended plans: most ÷ "
           "least", "2", "events", _spread),
    Target("an event that changes nothing (the dearest)", "≤ 0.05 ms", "events", _unchanged),
    Target("taking over a plan, 1,000 robots x 10,000 tasks", "≤ 1 s", "core", _taken_over),
    Target("dispatch: last dependency's report put → order at the worker, paced, 50 x 1,000",
           "p99 ≤ 10 ms, p50 ≤ 8 x Zenoh's", "dispatch", _dispatch(False)),
    Target("the same while another plan is being made", "the same", "dispatch", _dispatch(True)),
    Target("1,000 · 10,000 goals told, `step` alone", "linear, ≤ 1 s", "goals", _goals("step")),
    Target("the same as sentences", "linear", "goals", _goals("step, as sentences")),
    Target("the same through the planner, over Zenoh", "linear", "goals", _goals("planner")),
    Target("planner ready after kill -9, by missions of 16 tasks lived", "≤ 1 s whatever the past",
           "restart", _ready),
    Target("planner ready with 250,000 reports in the store", "≤ 1 s", "restart", _full),
    Target("idle planner, 120,000 reports stored", "≤ 1 % (router ≤ 1 %)", "idle", _idle_planner),
    Target("idle worker, of a core for each robot", "≤ 0.2 %", "idle", _idle_workers),
    Target("50 robots, MuJoCo, with their workers, of real time", "≥ 4 x", "physics", _physics),
    Target("500 missions and more, with restarts in between: time, memory, files",
           "flat after retention", "lifetime", _lifetime),
    Target("500 missions, with what people do by chance and restarts in between: goals, tasks, "
           "growth", "reached, deleted or failed for a true reason; none twice; flat",
           "operators", _operators),
    Target("recorder over 600 s of missions", "≤ 60 s CPU, bounded memory; files that roll",
           "recording", _recorder),
    Target("confirmed writes, 64 at once; one alone", "≥ 10,000/s; p99 ≤ 3 ms", "writes", _writes),
)  # fmt: skip
