"""The recorder beside a fleet that does one mission after the other: CPU, memory, files."""

from __future__ import annotations

import asyncio
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.scale.processes import folder_mb
from benchmarks.scale.soak import soaking

SECONDS = 600.0
FOLDER = "recording"


def measure(quick: bool) -> list[dict[str, Any]]:
    """A row for each sixth of the time."""
    return asyncio.run(_run(60.0 if quick else SECONDS))


async def _run(seconds: float) -> list[dict[str, Any]]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        async with soaking(folder) as soak:
            recordings = folder / FOLDER
            recordings.mkdir()
            recorder = soak.fleet.robotctl(
                "record", ("recording to",), "record", str(recordings / "missions.rrd")
            )
            await recorder.start()
            try:
                rows, missions, began_s = [], 0, time.perf_counter()
                for sixth in range(1, 7):
                    while time.perf_counter() - began_s < seconds * sixth / 6:
                        await soak.mission(missions)
                        missions += 1
                    rows.append(
                        {
                            "after_s": time.perf_counter() - began_s,
                            "missions": missions,
                            "cpu_s": recorder.cpu_s(),
                            "rss_mb": recorder.rss_mb(),
                            "files": sum(1 for _ in recordings.iterdir()),
                            "files_mb": folder_mb(recordings),
                        }
                    )
            finally:
                await recorder.stop()
        return rows
