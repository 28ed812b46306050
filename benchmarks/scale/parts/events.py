"""One event of a running plan, by tasks, robots and plans that have ended before: CPU time.

The event is put to the same state again and again, which `step` allows, being pure.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median
from typing import Any

from benchmarks.scale import errands
from benchmarks.scale.core_run import CoreRun
from benchmarks.scale.errands import TASKS_A_GOAL
from fleet.core import events
from fleet.core.events import Event
from keyexpr_schema.payloads.tasks import ReportState

ROBOTS = (2, 50, 1000)
TASKS = (100, 1000, 10_000)
ENDED = (1, 100)
REPEATS = 200
LIMIT_S = 2.0
FIRST_ENDED = 20_000
ONE_MORE = 30_000
"""A goal that no plan has."""


def measure(quick: bool) -> list[dict[str, Any]]:
    """A row for each size."""
    robots, tasks = (ROBOTS[:2], TASKS[:2]) if quick else (ROBOTS, TASKS)
    return [_row(r, t, e) for r in robots for t in tasks for e in ENDED]


def _row(robots: int, tasks: int, ended: int) -> dict[str, Any]:
    run = CoreRun(robots)
    run.live(ended, first=FIRST_ENDED)
    run.put_cups([ONE_MORE])
    run.begin("p", range(tasks // TASKS_A_GOAL))
    run.work(limit_s=30.0, tasks=10)
    started = _next(run, lambda event: _reports(event, ReportState.STARTED))
    begun_ms = _median_ms(run, started)
    run.apply(started)
    run.waiting.remove(started)
    goal, sentence = (
        events.GoalPut(goal=errands.goal(ONE_MORE, as_sentence), **run.at())
        for as_sentence in (False, True)
    )
    return {
        "robots": robots,
        "tasks": tasks,
        "ended": ended,
        "task_started_ms": begun_ms,
        "said_again_ms": _median_ms(run, started),
        "timer_ms": _median_ms(run, events.TimerFired(**run.at())),
        "task_ended_ms": _median_ms(
            run, _next(run, lambda event: _reports(event, ReportState.SUCCEEDED))
        ),
        "goal_ms": _median_ms(run, goal),
        "sentence_ms": _median_ms(run, sentence),
        "own_fact_ms": _median_ms(run, _next(run, lambda e: isinstance(e, events.FactPut))),
    }


def _reports(event: Event, state: ReportState) -> bool:
    return isinstance(event, events.ReportReceived) and event.report.state is state


def _next(run: CoreRun, wanted: Callable[[Event], bool]) -> Event:
    """The next event that is wanted; those before it are applied."""
    while not wanted(run.waiting[0]):
        run.apply(run.waiting.popleft())
    return run.waiting[0]


def _median_ms(run: CoreRun, event: Event) -> float:
    took: list[float] = []
    while len(took) < REPEATS and sum(took) < LIMIT_S:
        began_s = time.process_time()
        run.tried(event)
        took.append(time.process_time() - began_s)
    return 1e3 * median(took)
