"""Arms that do not drive, and a carrier that comes within their reach."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.demo_process import demo, left_behind

pytestmark = [pytest.mark.e2e, pytest.mark.slow]


def test_a_carrier_brings_things_from_one_fixed_arm_to_the_other(tmp_path: Path) -> None:
    out = tmp_path / "run"
    done = demo("workshop", out, "mujoco")
    logs = "\n".join(f"{log.name}:\n{log.read_text()[-1500:]}" for log in out.glob("*.log"))
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}\n{logs}"
    told: dict[str, Any] = json.loads(done.stdout)
    for verdict in told["goals"]:
        assert (verdict["physics"], verdict["planner"]) == ("holds", "reached")
    assert (told["contacts"]["robot_robot"], told["contacts"]["robot_wall"]) == (0, 0)
    assert "failed" not in {task["state"] for task in told["tasks"]}
    drives = {task["robot"] for task in told["tasks"] if task["skill"] == "navigate"}
    assert drives == {"locobot"}
    (gear,) = [t for t in told["tasks"] if t["skill"] == "place_on"]
    assert (gear["robot"], gear["args"]["object"]) == ("bench_arm", "gear_1")
    assert left_behind(out) == []
