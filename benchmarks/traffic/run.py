"""Measures traffic and writes the page: `python -m benchmarks.traffic.run --out docs/benchmarks`.

Simulated seconds; only the CPU times depend on the machine.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from statistics import mean

import msgspec

from benchmarks.traffic.arrivals import Outcome, Trips
from benchmarks.traffic.building import building
from benchmarks.traffic.corridor import corridor_per_minute
from benchmarks.traffic.page import page
from benchmarks.traffic.plots import draw

ROOMS = 4
"""On each side of the corridor: eight doors."""
SIZES, DOOR_SIZES = (5, 10, 20, 30, 50), (2, 4, 8, 12)
SEEDS = (1, 2, 3)
SECONDS = 300.0
BEFORE = "traffic-before.json"


class Measured(msgspec.Struct, frozen=True, kw_only=True):
    """Means over the seeds, by number of robots: in a building, and at two doors in a row."""

    building: tuple[Outcome, ...]
    door: tuple[Outcome, ...]

    @property
    def door_per_minute(self) -> float:
        """How many robots get through one door in a minute, at the most."""
        return max(outcome.per_minute for outcome in self.door)


def measure(seconds: float = SECONDS) -> Measured:
    """All of it; some minutes."""
    return Measured(
        building=tuple(_means(ROOMS, SIZES, seconds)), door=tuple(_means(1, DOOR_SIZES, seconds))
    )


def _means(rooms: int, sizes: tuple[int, ...], seconds: float) -> Iterator[Outcome]:
    world = building(rooms)
    for size in sizes:
        print(f"{2 * rooms} rooms, {size} robots", file=sys.stderr)
        runs = [Trips(world, size, seed).run(seconds) for seed in SEEDS]
        yield Outcome(
            robots=size,
            seconds=seconds,
            per_minute=mean(run.per_minute for run in runs),
            never=sum(run.never for run in runs),
            failed=sum(run.failed for run in runs),
            contacts=sum(run.contacts for run in runs),
            longest_s=max(run.longest_s for run in runs),
            cpu_s=mean(run.cpu_s for run in runs),
        )


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks"))
    parser.add_argument("--seconds", type=float, default=SECONDS)
    given = parser.parse_args()
    now = measure(given.seconds)
    (given.out / "traffic.json").write_bytes(msgspec.json.format(msgspec.json.encode(now)))
    known = given.out / BEFORE
    before = msgspec.json.decode(known.read_bytes(), type=Measured) if known.exists() else None
    limit = now.door_per_minute * 2 * ROOMS / 2  # every trip is through two doors
    draw(given.out / "traffic.png", now.building, before.building if before else (), limit)
    (given.out / "traffic.md").write_text(
        page(
            now.building,
            now.door,
            before.building if before else (),
            before.door if before else (),
            limit,
            corridor_per_minute(building(ROOMS), 0.6),
        ),
        encoding="utf-8",
    )


if __name__ == "__main__":
    main()
