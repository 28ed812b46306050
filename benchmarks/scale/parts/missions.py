"""A hundred thousand missions through core and store: see `benchmarks.scale.long_life`."""

from __future__ import annotations

import asyncio
import tempfile
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.scale.long_life import LongLife

MISSIONS = 100_000
QUICK = 1000
PARTS = 10


def measure(quick: bool) -> list[dict[str, Any]]:
    """A row for each tenth of the missions; after each, planner and store start again."""
    missions = (QUICK if quick else MISSIONS) // PARTS
    rows = []
    with tempfile.TemporaryDirectory() as folder, LongLife(Path(folder)) as life:
        for part in range(PARTS):
            began_s = time.process_time()
            asyncio.run(life.live_through(missions))
            took_s = time.process_time() - began_s
            rows.append(
                {
                    "missions": f"{part * missions + 1:,} to {(part + 1) * missions:,}",
                    "cpu_ms": 1000 * took_s / missions,
                    **asdict(life.size()),
                    "started_s": life.start_again(),
                }
            )
    return rows
