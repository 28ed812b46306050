"""On and in, what must be opened, a switch, a person; and what is looked for in closed things."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.demo_process import demo, left_behind
from tests.support.furnished import YAML

pytestmark = [pytest.mark.e2e, pytest.mark.slow]

HIDDEN = """
mission: hidden-cup
world: flat.yaml
robots:
  - {spec: hsr, start: {at_m: [2.3, 2.5]}}
  - {spec: locobot, start: {at_m: [6.5, 2.5]}}
objects:
  cup_1: {in: dresser_drawer_2, at_m: [-0.1, -0.08]}
  mug_1: null
states:
  cupboard: {is_open: false}
goals: [Find a cup somewhere and bring it to the hall.]
"""


def told(mission: str, out: Path, backend: str) -> dict[str, Any]:
    """What a demo says at its end, if all is well."""
    done = demo(mission, out, backend)
    logs = "\n".join(f"{log.name}:\n{log.read_text()[-1500:]}" for log in out.glob("*.log"))
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}\n{logs}"
    assert left_behind(out) == []
    found: dict[str, Any] = json.loads(done.stdout)
    for verdict in found["goals"]:
        assert (verdict["physics"], verdict["planner"]) == ("holds", "reached")
    assert (found["contacts"]["robot_robot"], found["contacts"]["robot_wall"]) == (0, 0)
    return found


@pytest.mark.parametrize("backend", ["kinematic", "mujoco"])
def test_a_home_is_served(tmp_path: Path, backend: str) -> None:
    found = told("apartment", tmp_path / "run", backend)
    conditions = [row["condition"] for verdict in found["goals"] for row in verdict["conditions"]]
    assert [(row["relation"], row["subject"], row["value"]) for row in conditions] == [
        ("in", "spoon_1", "bowl_1"),
        ("on", "cup_1", "dining_table"),
        ("is_on", "floor_lamp", True),
        ("at", "remote_1", "anna"),
    ]
    opened = {task["args"]["thing"] for task in found["tasks"] if task["skill"] == "open"}
    assert opened == {"kitchen_cupboard", "kitchen_unit_drawer_1"}
    assert {task["state"] for task in found["tasks"]} == {"succeeded"}


def test_a_cup_is_found_in_a_closed_drawer(tmp_path: Path) -> None:
    """The lower one: it is opened before the upper one, which would be in the way."""
    (tmp_path / "flat.yaml").write_text(YAML)
    mission = tmp_path / "hidden-cup.yaml"
    mission.write_text(HIDDEN)
    found = told(str(mission), tmp_path / "run", "mujoco")
    (verdict,) = found["goals"]
    assert "cup_1 lies in hall on " in verdict["sentence"]
    done = [task for task in found["tasks"] if task["state"] == "succeeded"]
    looked = [task["args"]["container"] for task in done if task["skill"] == "look_into"]
    assert "dresser_drawer_2" in looked
    assert {task["robot"] for task in done if task["skill"] == "open"} == {"hsr"}
    assert "failed" not in {task["state"] for task in found["tasks"]}
