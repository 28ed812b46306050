"""What an idle fleet costs: shares of a core over a while in which nothing happens.

Planner and router with reports of plans that are over in the store; a worker on a simulated robot.
"""

from __future__ import annotations

import asyncio
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.scale.processes import Child, processes, share_of_core
from benchmarks.scale.simulated_fleet import simulated
from benchmarks.scale.stored_past import store_reports

REPORTS = 120_000
READY_S = 60.0
WATCHED_S = 30.0
SETTLE_S = 10.0
"""What is loaded after a start is no idling."""
ROBOTS = (1, 50)


def measure(quick: bool) -> list[dict[str, Any]]:
    """A row for each process."""
    reports, seconds = (1000, 6.0) if quick else (REPORTS, WATCHED_S)
    rows = asyncio.run(_stored(reports, seconds))
    for robots in ROBOTS[: 1 if quick else None]:
        rows += asyncio.run(_workers(robots, seconds))
    return rows


async def _stored(reports: int, seconds: float) -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        store_reports(Path(folder) / "router", reports)
        async with processes(Path(folder), planner=False) as fleet:
            ready_s = await fleet.planner.start(READY_S)
            await asyncio.sleep(SETTLE_S)
            shares = await share_of_core(fleet.planner, fleet.router, seconds=seconds)
            return [
                _row(child, share, reports=reports, ready_s=ready_s)
                for child, share in zip((fleet.planner, fleet.router), shares, strict=True)
            ]


async def _workers(robots: int, seconds: float) -> list[dict[str, Any]]:
    """Robots that stand in a world that stands still; their workers are one process."""
    with tempfile.TemporaryDirectory() as folder:
        async with (
            processes(Path(folder)) as fleet,
            simulated(fleet, robots, "kinematic") as made,
        ):
            await asyncio.sleep(SETTLE_S)
            children = (*made.workers, made.sim, fleet.planner, fleet.router)
            shares = await share_of_core(*children, seconds=seconds)
            return [
                _row(child, share, robots=robots)
                for child, share in zip(children, shares, strict=True)
            ]


def _row(child: Child, share: float, **about: Any) -> dict[str, Any]:
    return {"process": child.name, **about, "share_of_core": share, "rss_mb": child.rss_mb()}
