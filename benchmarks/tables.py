"""What pages of measurements have in common: tables, and the machine they were measured on."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any


def machine() -> str:
    """What it was measured on, in a line."""
    name = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        models = [
            line.partition(":")[2].strip()
            for line in cpuinfo.read_text(encoding="utf-8").splitlines()
            if line.startswith("model name")
        ]
        name = models[0] if models else name
    return (
        f"{name}, {os.cpu_count()} cores, {platform.system()} {platform.release()}, "
        f"Python {platform.python_version()}, {datetime.now(UTC):%Y-%m-%d}"
    )


def as_markdown(head: Sequence[str], rows: Sequence[tuple[str, ...]]) -> str:
    """A table."""
    lines = ["| " + " | ".join(head) + " |", "| " + " | ".join("---" for _ in head) + " |"]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def as_json(measured: dict[str, Any]) -> str:
    """A line a part, numbers to six digits."""
    rounded = json.loads(json.dumps(measured), parse_float=lambda text: float(f"{float(text):.6g}"))
    parts = (
        f"{json.dumps(part)}: {json.dumps(about, separators=(',', ':'))}"
        for part, about in rounded.items()
    )
    return "{\n" + ",\n".join(parts) + "\n}\n"
