"""From `kill -9` of the planner to its being ready again, by what it has lived through.

Ready is what it says on stdout, so that the start of Python and all imports are counted. Missions
are four goals of four tasks each, one after the other, by the real router and planner.
"""

from __future__ import annotations

import asyncio
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.scale.errands import Errands
from benchmarks.scale.keys_run import KeysRun, keys_run
from benchmarks.scale.processes import Processes, folder_mb, processes
from benchmarks.scale.stored_past import store_reports

MISSIONS = (1, 50, 338)
GOALS_A_MISSION = 4
ROBOTS = 8
LIMIT_S = 240.0
"""How long missions are lived through; fewer where that does not suffice."""
RESTARTS = 3
REPORTS = 250_000
READY_S = 60.0


def measure(quick: bool) -> list[dict[str, Any]]:
    """Rows by missions lived, and one with a store full of reports."""
    lived = asyncio.run(_lived(MISSIONS[:1] if quick else MISSIONS))
    return [*lived, asyncio.run(_full_store(REPORTS // 100 if quick else REPORTS))]


async def _lived(counts: tuple[int, ...]) -> list[dict[str, Any]]:
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        async with processes(Path(folder)) as fleet, keys_run(fleet.endpoint, ROBOTS) as run:
            await run.put_fleet()
            until_s = time.perf_counter() + LIMIT_S
            mission = 0
            for count in counts:
                while mission < count and time.perf_counter() < until_s:
                    await _mission(run, mission)
                    mission += 1
                rows.append(
                    {
                        "what": "missions lived",
                        "wanted": count,
                        "number": mission,
                        **await _restarted(fleet),
                        "store_mb": folder_mb(fleet.folder / "router"),
                        "journal_mb": folder_mb(fleet.folder / "planner"),
                    }
                )
    return rows


async def _mission(run: KeysRun, number: int) -> None:
    first = number * GOALS_A_MISSION
    wanted = Errands(f"m{number}", range(first, first + GOALS_A_MISSION), ROBOTS)
    if not await run.mission(wanted, 60.0):
        raise SystemExit(f"mission {number} did not succeed: {run.plans.get(wanted.plan)}")


async def _restarted(fleet: Processes) -> dict[str, Any]:
    took: list[tuple[float, float]] = []
    for _ in range(RESTARTS):
        await fleet.planner.kill()
        ready_s = await fleet.planner.start(READY_S)
        if ready_s is None:
            return {"ready_s": None, "cpu_s": fleet.planner.cpu_s()}
        took.append((ready_s, fleet.planner.cpu_s()))
    return {
        "ready_s": median(ready_s for ready_s, _ in took),
        "cpu_s": median(cpu_s for _, cpu_s in took),
        "rss_mb": fleet.planner.rss_mb(),
    }


async def _full_store(count: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        store_reports(Path(folder) / "router", count)
        async with processes(Path(folder), planner=False) as fleet:
            return {
                "what": "reports in the store",
                "wanted": count,
                "number": count,
                **await _restarted(fleet),
            }
