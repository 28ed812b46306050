"""Tasks a second through `step` alone, by robots and tasks; events by kind; taking over a plan.

CPU time, in memory: robots report what they are ordered at once, and the planner's own facts come
back to it.
"""

from __future__ import annotations

import time
from collections import defaultdict
from statistics import median
from typing import Any

from benchmarks.scale.core_run import CoreRun
from benchmarks.scale.errands import TASKS_A_GOAL, Errands
from fleet.core import events
from fleet.core.events import Event

ROBOTS = (10, 50, 200, 1000)
TASKS = (100, 1000, 10_000)
LIMIT_S = 30.0
TAKEN_OVER = 3
"""How often the same plan is taken over by the same state; the median counts."""


def measure(quick: bool) -> list[dict[str, Any]]:
    """A row for each size."""
    robots, tasks = (ROBOTS[:2], TASKS[:2]) if quick else (ROBOTS, TASKS)
    return [_run(r, t, LIMIT_S / 10 if quick else LIMIT_S) for r in robots for t in tasks]


def _run(robots: int, tasks: int, limit_s: float) -> dict[str, Any]:
    took: dict[str, list[float]] = defaultdict(list)

    def watched(event: Event, seconds: float, changed: bool) -> None:
        took[_kind(event, changed)].append(seconds)

    run = CoreRun(robots, watched)
    began_s = time.process_time()
    wanted = Errands("p", range(tasks // TASKS_A_GOAL), robots)
    run.put_cups(wanted.numbers)
    run.put_goals(wanted.numbers)
    answer = run.ask(wanted)
    setup_s = time.process_time() - began_s
    for _ in range(TAKEN_OVER - 1):
        before_s = time.process_time()
        run.tried(answer)
        took["taken over"].append(time.process_time() - before_s)
    run.apply(answer)
    taken_over_s = median(took["taken over"])
    took.clear()
    worked_s = run.work(limit_s)
    done = run.succeeded["p"]
    return {
        "robots": robots,
        "tasks": tasks,
        "setup_s": setup_s,
        "taken_over_s": taken_over_s,
        "done": done,
        "worked_s": worked_s,
        "tasks_a_second": done / worked_s,
        "finished": done == wanted.tasks,
        "events": run.events,
        **{
            f"{kind}_ms": {"p50": 1e3 * median(s), "p99": 1e3 * sorted(s)[int(0.99 * len(s))]}
            for kind, s in took.items()
        },
    }


def _kind(event: Event, changed: bool) -> str:
    if isinstance(event, events.PlanningSucceeded):
        return "taken over"
    if not changed:
        return "unchanged"
    if isinstance(event, events.ReportReceived):
        return event.report.state.value
    return "other"
