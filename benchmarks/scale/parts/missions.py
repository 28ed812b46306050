"""A hundred thousand missions through core and store: see `benchmarks.scale.long_life`.

It takes as long as it takes: whoever ends it early, and starts it again, goes on where it was.
"""

from __future__ import annotations

import asyncio
import json
import shutil
import tempfile
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.scale.long_life import LongLife

MISSIONS = 100_000
QUICK = 1000
PARTS = 10
SLICES = 10
"""Of a part; after each it is noted how far it has come."""
PROGRESS = "progress.json"


def measure(quick: bool) -> list[dict[str, Any]]:
    """A row for each tenth of the missions; after each, planner and store start again."""
    if quick:
        with tempfile.TemporaryDirectory() as temporary:
            return lived(Path(temporary), QUICK)
    folder = Path(tempfile.gettempdir()) / "robotfleet-missions"
    folder.mkdir(exist_ok=True)
    rows = lived(folder, MISSIONS)
    shutil.rmtree(folder)
    return rows


def lived(folder: Path, missions: int) -> list[dict[str, Any]]:
    """The rows of so many missions, those lived in `folder` before included."""
    progress = folder / PROGRESS
    noted = json.loads(progress.read_text()) if progress.exists() else {"rows": []}
    rows: list[dict[str, Any]] = noted["rows"]
    measured, cpu_s = noted.get("measured", 0), noted.get("cpu_s", 0.0)
    size = missions // PARTS
    with LongLife(folder) as life:
        for part in range(len(rows), PARTS):
            while life.missions < (part + 1) * size:
                some = min(size // SLICES, (part + 1) * size - life.missions)
                began_s = time.process_time()
                asyncio.run(life.live_through(some))
                measured, cpu_s = measured + some, cpu_s + time.process_time() - began_s
                noted = {"rows": rows, "measured": measured, "cpu_s": cpu_s}
                progress.write_text(json.dumps(noted))
            rows.append(
                {
                    "missions": f"{part * size + 1:,} to {(part + 1) * size:,}",
                    "cpu_ms": 1000 * cpu_s / max(1, measured),
                    **asdict(life.size()),
                    "started_s": life.start_again(),
                }
            )
            measured, cpu_s = 0, 0.0
            progress.write_text(json.dumps({"rows": rows}))
    return rows
