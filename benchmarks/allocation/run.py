"""`make bench-allocation`: every benchmark of allocation, as tables, plots and a page.

`python -m benchmarks.allocation.run [--quick] [--only PART…] [--out docs/benchmarks]`. Results of a
part replace those of the same part in `allocation.json`; page and plots are made from all parts
there. `--quick` takes fewer households, no more than 1,000 tasks, and only short limits.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks.allocation import bench_balanced, bench_household, bench_makespan, report
from benchmarks.tables import as_json, machine
from fleet.allocators.makespan import DEADLINE_S

QUICK_SEEDS = 3


def main() -> None:
    """Run the parts that were asked for, and write everything."""
    parts = ("household", "sizes", "coalitions", "public", "rescheduling", "balanced")
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--quick", action="store_true")
    options.add_argument("--only", nargs="+", choices=parts, default=parts)
    options.add_argument(
        "--out", type=Path, help="folder for page, plots and data; else print only"
    )
    options.add_argument("--limit-s", type=float, default=DEADLINE_S, help="makespan, households")
    options.add_argument("--llm-config", type=Path, help="add the allocator llm with this model")
    given = options.parse_args()
    console = Console(width=180)
    measured: dict[str, Any] = {}
    known = given.out / "allocation.json" if given.out else None
    if known is not None:
        known.parent.mkdir(parents=True, exist_ok=True)
    if known is not None and known.exists():
        measured = json.loads(known.read_text(encoding="utf-8"))
    runs = _runs(given, console)
    for part in given.only:
        began_s = time.perf_counter()
        load = os.getloadavg()[0]
        results = runs[part]()
        measured[part] = {
            "command": " ".join(["python -m benchmarks.allocation.run", *sys.argv[1:]]),
            "machine": machine(),
            "load_before": round(load, 1),
            "took_s": round(time.perf_counter() - began_s, 1),
            "results": results,
        }
        report.show(part, measured[part], console)
        if known is not None:
            known.write_text(as_json(measured), encoding="utf-8")
    if given.out is not None:
        report.write(given.out, measured)


def _runs(given: argparse.Namespace, console: Console) -> dict[str, Callable[[], Any]]:
    seeds = QUICK_SEEDS if given.quick else bench_household.SEEDS
    limits_s = bench_makespan.LIMITS_S[:1] if given.quick else bench_makespan.LIMITS_S
    largest = 1000 if given.quick else 10_000

    def household() -> Any:
        compared = bench_household.allocators(given.limit_s, given.llm_config)
        return [asdict(run) for run in bench_household.runs(seeds, compared, console)]

    return {
        "household": household,
        "sizes": lambda: [
            asdict(o) for o in bench_makespan.sizes(largest, limits_s, console.print)
        ],
        "coalitions": lambda: bench_makespan.coalitions(),
        "public": lambda: [
            asdict(one) for one in bench_makespan.public(bench_makespan.PUBLIC_S, console.print)
        ],
        "rescheduling": lambda: [asdict(one) for one in bench_makespan.rescheduling()],
        "balanced": _balanced,
    }


def _balanced() -> list[dict[str, Any]]:
    """Rows of bench_balanced at its largest size, each in a process of its own."""
    found = []
    for kind in bench_balanced.KINDS:
        command = [sys.executable, "-m", "benchmarks.allocation.bench_balanced", "--one"]
        ran = subprocess.run(
            [*command, kind, "10000", "1000"], capture_output=True, text=True, check=True
        )
        found.append({"kind": kind, **json.loads(ran.stdout)})
    return found


if __name__ == "__main__":
    main()
