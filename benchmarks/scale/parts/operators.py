"""Five hundred missions among people who do things by chance: see `benchmarks.scale.operators`."""

from __future__ import annotations

import asyncio
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.scale.operators.soak import KILL_EVERY, MISSIONS, live, rows_of


def measure(quick: bool) -> list[dict[str, Any]]:
    """A row for each tenth of the missions; with the last stands what there was in all."""
    missions, kill_every = (10, 3) if quick else (MISSIONS, KILL_EVERY)
    with tempfile.TemporaryDirectory() as folder:
        return rows_of(asyncio.run(live(Path(folder), missions, kill_every, seed=0)))
