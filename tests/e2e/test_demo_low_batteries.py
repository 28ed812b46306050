"""The mission with small batteries, as a person runs it."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from tests.support.demo_process import demo

pytestmark = [pytest.mark.e2e, pytest.mark.slow]


def test_robots_charge_on_the_way_and_both_cups_arrive(tmp_path: Path) -> None:
    out = tmp_path / "run"
    done = demo("low-batteries", out, "kinematic")
    logs = "\n".join(f"{log.name}:\n{log.read_text()[-1500:]}" for log in out.glob("*.log"))
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}\n{logs}"
    told: dict[str, Any] = json.loads(done.stdout)
    assert {verdict["physics"] for verdict in told["goals"]} == {"holds"}
    charged = [t for t in told["tasks"] if t["skill"] == "charge" and t["state"] == "succeeded"]
    assert charged and {task["robot"] for task in charged} <= {"hsr", "locobot"}
    spans = sorted((task["start_s"], task["end_s"]) for task in charged)
    assert all(one[1] <= later[0] for one, later in pairwise(spans))
