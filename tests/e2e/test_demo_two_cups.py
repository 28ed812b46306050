"""The whole demo, as a person runs it: every process real, and the physics is the judge."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from tests.support.child_process import blocking_child
from tests.support.demo_process import demo, left_behind
from tests.support.polling import DEADLINE_S

pytestmark = [pytest.mark.e2e, pytest.mark.slow]


@pytest.mark.parametrize("backend", ["kinematic", "mujoco"])
def test_both_cups_arrive_and_the_physics_agrees(tmp_path: Path, backend: str) -> None:
    out = tmp_path / "run"
    begun_s = time.monotonic()
    done = demo("two-cups", out, backend)
    wall_s = time.monotonic() - begun_s

    logs = "\n".join(f"{log.name}:\n{log.read_text()[-1500:]}" for log in out.glob("*.log"))
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}\n{logs}"
    told: dict[str, Any] = json.loads(done.stdout)
    assert told["ok"] is True
    verdicts = {verdict["goal"]: verdict for verdict in told["goals"]}
    assert len(verdicts) == 2
    for verdict in verdicts.values():
        assert verdict["physics"] == "holds"
        assert verdict["planner"] == "reached"
    places = {
        verdict["conditions"][0]["condition"]["subject"]: verdict["conditions"][0]["sentence"]
        for verdict in verdicts.values()
    }
    assert "cup_1 lies in hallway on " in places["cup_1"]
    assert "cup_2 lies in living_room on " in places["cup_2"]

    assert told["contacts"]["robot_robot"] == 0
    assert told["tasks"]
    for task in told["tasks"]:
        if task["state"] == "succeeded":
            assert task["robot"] in ("hsr", "locobot")
            assert task["end_s"] >= task["start_s"] >= 0.0
        else:
            assert task["state"] == "cancelled", task
    assert set(told["idle_s"]) == {"hsr", "locobot"}
    for robot, idle_s in told["idle_s"].items():
        assert idle_s == pytest.approx(told["makespan_s"] - told["busy_s"][robot], abs=1e-6)
    assert told["makespan_s"] > 0.0
    assert told["real_time_factor"] > 0.0
    assert 0.0 < told["wall_s"] <= wall_s

    recording = Path(told["recording"])
    assert recording.stat().st_size > 1000
    assert json.loads((out / "summary.json").read_text()) == told
    assert left_behind(out) == []


def test_a_process_that_dies_is_said_with_its_log(tmp_path: Path) -> None:
    """A recording that cannot be written: the recorder ends at once, and so does the demo."""
    out = tmp_path / "run"
    (out / "recording.rrd").mkdir(parents=True)
    done = demo("two-cups", out, "kinematic")
    assert done.returncode == 1
    assert done.stdout == ""
    assert "Error: record ended unexpectedly" in done.stderr
    assert str(out / "record.log") in done.stderr
    assert left_behind(out) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_demo_that_is_interrupted_leaves_no_process(
    tmp_path: Path, number: signal.Signals
) -> None:
    out = tmp_path / "run"
    command = (sys.executable, "-m", "cli.main", "demo", "two-cups", "--backend", "kinematic")
    options = ("--headless-speed", "1", "--out", str(out))
    with blocking_child(*command, *options, stderr=subprocess.STDOUT) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if ": running" in line:
                break
        else:
            pytest.fail(f"no task ever ran; see {out}")
        process.send_signal(number)
        rest = process.stdout.read()
        code = process.wait(DEADLINE_S)
    assert code != 0
    assert "Traceback" not in rest
    assert left_behind(out) == []
