"""Both demonstrations with programs: orders carry several calls; what is found ends a search."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.demo_process import demo, left_behind

pytestmark = [pytest.mark.e2e, pytest.mark.slow, pytest.mark.timeout(300)]


@pytest.mark.parametrize("mission", ["two-cups", "find-cup"])
def test_robots_carry_out_programs(tmp_path: Path, mission: str) -> None:
    out = tmp_path / "run"
    done = demo(mission, out, "kinematic", "--programs")
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    told: dict[str, Any] = json.loads(done.stdout)
    assert {(goal["physics"], goal["planner"]) for goal in told["goals"]} == {("holds", "reached")}
    tasks = [task for task in told["tasks"] if task["start_s"] is not None]
    texts = [task["args"]["text"] for task in tasks if task["skill"] == "do"]
    # What needs nobody else is one order: fetching and bringing, or driving and searching.
    assert any(text.count(";") >= 1 for text in texts)
    assert {task["skill"] for task in tasks} <= {"do", "place_on_robot", "pick_from_robot"}
    if mission == "find-cup":
        assert told["revisions"] == {"plan-1": 2}
        (bring,) = [text for text in texts if "pick cup_1" in text]
        assert bring.endswith("place cup_1 hallway")
    assert left_behind(out) == []
