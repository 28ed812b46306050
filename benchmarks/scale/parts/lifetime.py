"""A fleet kept up through 2,500 missions with restarts in between: see `benchmarks.scale.soak`."""

from __future__ import annotations

import asyncio
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.scale.soak import live, summed_up

MISSIONS = 2500
KILL_EVERY = 50
LIMIT_S = 1200.0


def measure(quick: bool) -> list[dict[str, Any]]:
    """A row for each tenth of the missions."""
    missions, kill_every = (10, 3) if quick else (MISSIONS, KILL_EVERY)
    with tempfile.TemporaryDirectory() as folder:
        return summed_up(asyncio.run(live(Path(folder), missions, kill_every, LIMIT_S)))
