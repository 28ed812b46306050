"""The recorder beside a fleet that does one mission after the other: CPU, memory, files."""

from __future__ import annotations

import asyncio
import os
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.scale.processes import folder_mb
from benchmarks.scale.soak import soaking

SECONDS = 600.0
WITHOUT_S = 60.0
"""So long the same missions are lived through without a recorder beforehand."""
FOLDER = "recording"


def measure(quick: bool) -> list[dict[str, Any]]:
    """A row for the missions without a recorder, and one for each sixth of the time with it."""
    return asyncio.run(_run(*(10.0, 60.0) if quick else (WITHOUT_S, SECONDS)))


async def _run(without_s: float, seconds: float) -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        async with soaking(folder) as soak:
            before, began_s = 0, time.perf_counter()
            while time.perf_counter() - began_s < without_s:
                await soak.mission(before)
                before += 1
            rows: list[dict[str, Any]] = [
                {
                    "without": True,
                    "after_s": time.perf_counter() - began_s,
                    "missions": before,
                    "load": os.getloadavg()[0],
                }
            ]
            recordings = folder / FOLDER
            recordings.mkdir()
            recorder = soak.fleet.robotctl(
                "record", ("recording to",), "record", str(recordings / "missions.rrd")
            )
            await recorder.start()
            try:
                missions, began_s = 0, time.perf_counter()
                for sixth in range(1, 7):
                    while time.perf_counter() - began_s < seconds * sixth / 6:
                        await soak.mission(before + missions)
                        missions += 1
                    rows.append(
                        {
                            "without": False,
                            "after_s": time.perf_counter() - began_s,
                            "missions": missions,
                            "load": os.getloadavg()[0],
                            "cpu_s": recorder.cpu_s(),
                            "rss_mb": recorder.rss_mb(),
                            "files": sum(1 for _ in recordings.iterdir()),
                            "files_mb": folder_mb(recordings),
                        }
                    )
            finally:
                await recorder.stop()
        return rows
