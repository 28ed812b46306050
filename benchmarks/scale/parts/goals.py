"""Goals told, by number: through `step` (CPU time), and through a planner (wall time)."""

from __future__ import annotations

import asyncio
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.scale import errands
from benchmarks.scale.core_run import CoreRun
from benchmarks.scale.keys_run import keys_run
from benchmarks.scale.processes import processes
from fleet.core import events

GOALS = (100, 1000, 10_000)
CUPS = 100
ROBOTS = 50
LIMIT_S = 60.0


def measure(quick: bool) -> list[dict[str, Any]]:
    """A row for each number, way and form."""
    counts = GOALS[:2] if quick else GOALS
    rows = [_step(count, sentences) for sentences in (False, True) for count in counts]
    return rows + [asyncio.run(_planner(count)) for count in counts]


def _step(count: int, sentences: bool) -> dict[str, Any]:
    run = CoreRun(ROBOTS)
    run.put_cups(range(CUPS))
    told = 0
    began_s = time.process_time()
    for number in range(count):
        run.receive(events.GoalPut, goal=errands.goal(number, sentences, CUPS))
        told += 1
        if time.process_time() - began_s > LIMIT_S:
            break
    return {
        "way": "step, as sentences" if sentences else "step",
        "goals": count,
        "told": told,
        "took_s": time.process_time() - began_s,
    }


async def _planner(count: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        async with processes(Path(folder)) as fleet, keys_run(fleet.endpoint, ROBOTS) as run:
            await run.put_fleet()
            await run.put_cups(range(CUPS))
            cpu_s = fleet.planner.cpu_s()
            began_s = time.perf_counter()
            await run.put_goals(range(count), LIMIT_S, cups=CUPS)
            return {
                "way": "planner",
                "goals": count,
                "told": len(run.goals),
                "took_s": time.perf_counter() - began_s,
                "planner_cpu_s": fleet.planner.cpu_s() - cpu_s,
            }
