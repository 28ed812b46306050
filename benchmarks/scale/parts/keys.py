"""Tasks a second from end to end: the real router and planner, each a process, over Zenoh.

All robots are in the process that measures; they report at once what they are ordered. Plans are
proposed, with every actor pinned to a robot, so that what counts is what comes after planning.
"""

from __future__ import annotations

import asyncio
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.scale.errands import TASKS_A_GOAL, Errands
from benchmarks.scale.keys_run import keys_run
from benchmarks.scale.processes import processes

SIZES = ((50, 1000), (50, 10_000), (1000, 10_000))
LIMIT_S = 60.0
PLANNED_S = 180.0
"""How long a plan may take until its first order."""


def measure(quick: bool) -> list[dict[str, Any]]:
    """A row for each size."""
    sizes = ((10, 100), (50, 1000)) if quick else SIZES
    return [asyncio.run(_run(robots, tasks)) for robots, tasks in sizes]


async def _run(robots: int, tasks: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        async with processes(Path(folder)) as fleet, keys_run(fleet.endpoint, robots) as run:
            await run.put_fleet()
            wanted = Errands("p", range(tasks // TASKS_A_GOAL), robots)
            await run.put_cups(wanted.numbers)
            told = await run.put_goals(wanted.numbers, PLANNED_S)
            proposed_s = time.perf_counter()
            await run.propose(wanted)
            await run.until(lambda: bool(run.ordered) or "p" in run.ended, PLANNED_S)
            first_s = time.perf_counter()
            had_s = fleet.planner.cpu_s(), fleet.router.cpu_s(), time.process_time()
            await run.until(lambda: "p" in run.ended, LIMIT_S)
            took_s = run.ended.get("p", time.perf_counter()) - first_s
            done = run.done("p")
            return {
                "robots": robots,
                "tasks": tasks,
                "goals_told": told,
                "planned_s": first_s - proposed_s,
                "done": done,
                "worked_s": took_s,
                "tasks_a_second": done / took_s,
                "finished": "p" in run.ended and done == tasks,
                "planner_cpu_s": fleet.planner.cpu_s() - had_s[0],
                "router_cpu_s": fleet.router.cpu_s() - had_s[1],
                "robots_cpu_s": time.process_time() - had_s[2],
                "planner_rss_mb": fleet.planner.rss_mb(),
            }
