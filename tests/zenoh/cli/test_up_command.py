"""`robotctl up --detach`, and what others find of it, until `down`."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from cli.processes.up_state import running_state
from tests.support.polling import until
from tests.support.process_ids import alive
from tests.support.robotctl import Robotctl

pytestmark = [pytest.mark.e2e]


def pids(up: Any) -> dict[str, int]:
    return {each["name"]: each["process"]["pid"] for each in up["children"] if each["process"]}


async def test_a_fleet_is_up_until_it_is_taken_down(tmp_path: Path) -> None:
    robotctl = Robotctl("", tmp_path)
    del robotctl.env["ROBOTFLEET_ROUTER"]
    robotctl.env.pop("XDG_STATE_HOME", None)
    nothing = robotctl("ps")
    assert (nothing.code, nothing.out) == (1, "")
    assert "no fleet is up in realm robotfleet" in nothing.err

    started = robotctl(
        *("up", "two-cups", "--backend", "kinematic", "--speed", "max"),
        *("--detach", "--no-record", "--json"),
    )
    try:
        assert started.code == 0, started.err
        first = pids(started.data)
        assert list(first) == ["router", "sim", "planner", "workers"]
        for again in (robotctl("up"), robotctl("up", "--detach")):
            assert again.code == 1
            assert again.err.startswith("Error: a fleet is up in realm robotfleet already (pid ")

        # Nobody says where the router is.
        robots = robotctl("robots", "--json").data
        assert [(r["spec"]["robot"], r["connected"]) for r in robots] == [
            ("hsr", True),
            ("locobot", True),
        ]

        of_a_robot = robotctl("logs", "hsr")
        assert of_a_robot.code == 1 and "`robotctl logs workers`" in of_a_robot.err

        os.kill(first["planner"], signal.SIGKILL)

        def again_up() -> bool:
            up = running_state(tmp_path / ".local/state/robotfleet/robotfleet")
            planner = next(each for each in up.children if each.name == "planner") if up else None
            return planner is not None and planner.restarts == 1 and planner.process is not None

        await until(again_up)
        told = robotctl("logs", "up", "-n", "100").out
        assert told.startswith("starting two-cups")  # nobody has emptied it
        assert "planner ended unexpectedly by SIGKILL" in told
        now = pids(robotctl("ps", "--json").data)
    finally:
        ended = robotctl("down")
    assert (ended.code, ended.out) == (0, "the fleet is down\n")
    assert now["planner"] != first["planner"]
    assert [name for name, pid in now.items() if alive(pid)] == []
    assert "world home running" in robotctl("logs", "sim").out  # also when it is over
