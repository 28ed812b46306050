"""Missions with small batteries, as a person runs them."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from tests.support.demo_process import demo

TWO_CHARGERS = """
mission: two-chargers
world: warehouse
robots:
  - &low
    spec: hsr
    robot: r1
    start: {at_m: [4.0, 8.0]}
    battery: {capacity_wh: 20, idle_w: 10, driving_w: 60, working_w: 45, charging_w: 600}
    charge: 14
  - {<<: *low, robot: r2, start: {at_m: [7.0, 8.0]}}
  - {<<: *low, robot: r3, start: {at_m: [9.0, 8.0]}}
  - {<<: *low, robot: r4, start: {at_m: [11.0, 8.0]}}
statements: [Parcel 1 is in store a.]
goals: [Bring parcel 1 to dispatch.]
"""

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


def test_four_robots_share_two_chargers(tmp_path: Path) -> None:
    mission, out = tmp_path / "two-chargers.yaml", tmp_path / "run"
    mission.write_text(TWO_CHARGERS)
    done = demo(str(mission), out, "kinematic")
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    tasks = json.loads(done.stdout)["tasks"]
    at = [task["args"]["charger"] for task in tasks if task["skill"] == "charge"]
    assert {at.count("charger_west"), at.count("charger_east")} == {2}
