"""The paper's second demonstration: nobody knows where the cup is, and who finds it cannot pick."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.demo_process import demo, left_behind

pytestmark = [pytest.mark.e2e, pytest.mark.slow]


def test_one_finds_the_cup_and_the_other_brings_it(tmp_path: Path) -> None:
    out = tmp_path / "run"
    done = demo("find-cup", out, "mujoco")
    logs = "\n".join(f"{log.name}:\n{log.read_text()[-1500:]}" for log in out.glob("*.log"))
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}\n{logs}"
    told: dict[str, Any] = json.loads(done.stdout)

    # Ground truth.
    (verdict,) = told["goals"]
    assert (verdict["physics"], verdict["planner"]) == ("holds", "reached")
    assert "cup_1 lies in hallway on " in verdict["sentence"]
    assert told["contacts"]["robot_robot"] == 0
    assert told["contacts"]["robot_wall"] == 0

    # Both looked for it, at the same time and in different places.
    assert told["revisions"] == {"plan-1": 2}
    tasks = told["tasks"]
    ended = {"succeeded", "cancelled"}
    assert {task["state"] for task in tasks} <= ended
    begun = [task for task in tasks if task["start_s"] is not None]
    searches = [task for task in begun if task["skill"] == "search"]
    assert len({task["args"]["place"] for task in searches}) == len(searches)
    robots = ("hsr", "locobot")
    assert {task["robot"] for task in tasks if task["skill"] == "search"} == set(robots)
    one, other = (next(t for t in searches if t["robot"] == robot) for robot in robots)
    assert one["start_s"] < other["end_s"] and other["start_s"] < one["end_s"]

    # Who found it cannot take it: the other one fetches it from there, and stops looking for it.
    found = next(task for task in searches if task["args"]["place"] == "living_room")
    assert (found["robot"], found["state"]) == ("locobot", "succeeded")
    (pick,) = [task for task in begun if task["skill"] == "pick"]
    assert (pick["robot"], pick["state"]) == ("hsr", "succeeded")
    assert pick["args"]["object"] == "cup_1"
    assert pick["args"]["place"] == "living_room"
    assert pick["start_s"] > found["start_s"]
    assert all(task["end_s"] <= pick["start_s"] for task in searches)
    last = max(begun, key=lambda task: task["end_s"])
    assert (last["skill"], last["robot"], last["args"]["place"]) == ("place", "hsr", "hallway")
    assert left_behind(out) == []
