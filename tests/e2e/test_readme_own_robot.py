"""The README's five minutes: a third robot and a goal of one's own, as it tells a newcomer."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tests.support.demo_process import demo, left_behind

pytestmark = [pytest.mark.e2e, pytest.mark.slow]

ROOT = Path(__file__).parents[2]


def mission_of_the_readme(folder: Path) -> Path:
    """The README's example, pasted whole into the file that it names."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    section = text.split("## Your own robot and goal")[1].split("\n## ")[0]
    [block] = re.findall(r"```yaml\n(.*?)```", section, re.DOTALL)
    [(room, name)] = re.findall(r"`configs/(\w+)/`, as \*(\w+\.yaml)\*", section)
    path = folder / room / name
    path.parent.mkdir(parents=True)
    path.write_text(block, encoding="utf-8")
    return path


def test_a_third_robot_and_an_own_goal(tmp_path: Path) -> None:
    out = tmp_path / "run"
    done = demo(str(mission_of_the_readme(tmp_path / "configs")), out, "mujoco")
    logs = "\n".join(f"{log.name}:\n{log.read_text()[-1500:]}" for log in out.glob("*.log"))
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}\n{logs}"
    told = json.loads(done.stdout)
    [verdict] = told["goals"]
    assert (verdict["physics"], verdict["planner"]) == ("holds", "reached")
    assert told["contacts"]["robot_robot"] == 0
    done_by = {task["robot"] for task in told["tasks"] if task["state"] == "succeeded"}
    assert {"hsr_2", "locobot"} <= done_by
    assert left_behind(out) == []
