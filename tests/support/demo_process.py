"""`robotctl demo` as a process."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


def demo(mission: str, out: Path, backend: str, *more: str) -> subprocess.CompletedProcess[str]:
    """Run `robotctl demo MISSION --json` to its end."""
    return subprocess.run(
        [
            *(sys.executable, "-m", "cli.main", "demo", mission),
            *("--json", "--backend", backend, "--out", str(out), *more),
        ],
        capture_output=True,
        text=True,
        timeout=540,
    )


def left_behind(out: Path) -> list[str]:
    """Command lines of processes that were started for `out` and still run."""
    lines = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = entry.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue
        if str(out) in line and int(entry.parent.name) != os.getpid():
            lines.append(line)
    return lines
