"""The paper's second demonstration: nobody knows where the cup is, and who finds it cannot pick."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from fleet.timeline.reader import rows, summary
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
    recorded(Path(told["recording"]), begun)
    assert left_behind(out) == []


def recorded(path: Path, begun: list[dict[str, Any]]) -> None:
    """All is in its place from the beginning, every task has its bar, every revision its graph."""
    found = summary(path)
    assert found.sim_span_s is not None
    bodies = [name for name in found.entities if name.startswith("/world/bodies/")]
    moving = [
        name for name in bodies if "Transform3D:translation" in found.entities[name].components
    ]
    assert {name.split("/")[3] for name in moving} == {"hsr", "locobot", "cup_1"}
    for name in moving:
        first = rows(path, name, "translation")[0]
        assert first.sim_s == found.sim_span_s[0] and any(first.value[0])
    for robot in ("hsr", "locobot"):
        states = rows(path, f"/robots/{robot}", "state")
        bars = {row.value[0].partition("#")[0]: row.sim_s for row in states if row.value[0]}
        for task in (task for task in begun if task["robot"] == robot):
            assert bars[f"plan-1/{task['task']}"] == pytest.approx(task["start_s"], abs=0.1)
    assert {"/fleet/dag/plan-1/1", "/fleet/dag/plan-1/2"} <= found.entities.keys()
    last = rows(path, "/fleet/dag/plan-1/2", "labels")[-1].value
    assert last[0] == "plan-1 · revision 2 · succeeded"
    assert all("succeeded" in label for label in last)
