"""`make bench-scale`: what events, orders, starts and idle hours cost: tables, curves and a page.

`python -m benchmarks.scale.run [--quick] [--only PART,…] [--out docs/benchmarks]`. Results of a
part replace those of the same part in `scale.json`; page and curves are made from all parts there.
`--quick` takes small sizes. With `--before` results go to `scale-before.json`, beside which the
page puts those of now.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks.scale import report
from benchmarks.tables import as_json, machine

PARTS = (
    "core",
    "events",
    "goals",
    "keys",
    "dispatch",
    "writes",
    "restart",
    "idle",
    "physics",
    "lifetime",
    "operators",
    "missions",
    "recording",
)


def main() -> None:
    """Run the parts that were asked for, and write everything."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--quick", action="store_true")
    options.add_argument("--only", default=",".join(PARTS), help="parts, with commas between them")
    options.add_argument("--out", type=Path, help="folder for page, curves and data")
    options.add_argument("--before", action="store_true", help="keep results as those to compare")
    given = options.parse_args()
    wanted = given.only.split(",")
    if unknown := [part for part in wanted if part not in PARTS]:
        options.error(f"there is no part {unknown[0]!r}; there are {', '.join(PARTS)}")
    console = Console(width=180)
    for part in wanted:
        about = _measured(part, given.quick)
        report.show(part, about, console)
        if given.out is not None:
            _keep(given.out / ("scale-before.json" if given.before else "scale.json"), part, about)
    if given.out is not None and not given.before:
        report.write(given.out)


def _measured(part: str, quick: bool) -> dict[str, Any]:
    measure: Callable[[bool], Any] = import_module(f"benchmarks.scale.parts.{part}").measure
    began_s, load = time.perf_counter(), os.getloadavg()[0]
    results = measure(quick)
    return {
        "command": _command(),
        "machine": machine(),
        "commit": _commit(),
        "load_before": round(load, 1),
        "load_after": round(os.getloadavg()[0], 1),
        "took_s": round(time.perf_counter() - began_s, 1),
        "results": results,
    }


def _command() -> str:
    """What was called; of folders the last two parts, wherever they lie."""
    own = ["/".join(Path(word).parts[-2:]) if "/" in word else word for word in sys.argv[1:]]
    return " ".join(["python -m benchmarks.scale.run", *own])


def _commit() -> str:
    """The commit of the code that is measured, and whether files differ from it."""

    def git(*arguments: str) -> str:
        done = subprocess.run(
            ["git", *arguments],
            cwd=Path(__file__).parent,
            capture_output=True,
            text=True,
            check=False,
        )
        return done.stdout.strip()

    changed = git("status", "--porcelain", "--untracked-files=no", ":/fleet", ":/keyexpr_schema",
                  ":/workers", ":/sim", ":/cli")  # fmt: skip
    return (git("rev-parse", "--short", "HEAD") or "?") + (" with changes" if changed else "")


def _keep(file: Path, part: str, about: dict[str, Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    kept = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    file.write_text(as_json({**kept, part: about}), encoding="utf-8")


if __name__ == "__main__":
    main()
