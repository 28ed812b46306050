"""`robotctl stop` and `resume`, where nobody is there to obey."""

from __future__ import annotations

from pathlib import Path

from tests.support.robotctl import Robotctl

CONFIGS = Path(__file__).parents[3] / "configs"
ROBOTS = [str(CONFIGS / "robots" / f"{name}.yaml") for name in ("hsr", "locobot")]


def test_who_has_not_confirmed_is_named_and_a_stop_stands_until_it_is_lifted(
    robotctl: Robotctl,
) -> None:
    robotctl("register", *ROBOTS)
    stopped = robotctl("stop", "--all", "--why", "smoke", "--as", "ana", "--wait", "0.1", "--json")
    assert stopped.code == 1
    assert stopped.data["confirmed"] == []
    assert stopped.data["unconfirmed"] == {
        "hsr": "its worker is not connected",
        "locobot": "its worker is not connected",
    }
    first = stopped.data["stop"]["stop"]
    again = robotctl("stop", "--robot", "hsr", "--as", "bob", "--wait", "0")
    assert again.code == 1 and "NOT CONFIRMED: hsr: its worker is not connected" in again.err
    shown = " ".join(robotctl("status").out.split())
    assert f"emergency stop {first} by ana (smoke) holds all robots (hsr, locobot)" in shown
    assert "NOT CONFIRMED by hsr, locobot" in shown

    released = robotctl("resume", "--robot", "locobot")
    assert (released.code, released.err) == (0, "")
    assert released.out.startswith("locobot may move: stop-")
    assert first in [stop["stop"] for stop in robotctl("status", "--json").data["stops"]]
    lifted = robotctl("resume", "--all", "--json").data
    assert len(lifted["lifted"]) == 2 and lifted["robots"] == ["hsr", "locobot"]
    assert robotctl("status", "--json").data["stops"] == []
    assert robotctl("resume", "--all").out == "No stop stands.\n"


def test_it_says_whom(robotctl: Robotctl) -> None:
    robotctl("register", *ROBOTS)
    for command in ("stop", "resume"):
        for wrong in ([], ["--all", "--robot", "hsr"]):
            done = robotctl(command, *wrong)
            assert done.code == 2 and "either --all or --robot NAME" in done.err
    unknown = robotctl("stop", "--robot", "hrs")
    assert unknown.code == 1
    assert "there is no robot 'hrs' (did you mean 'hsr'?)" in unknown.err
    assert robotctl("status", "--json").data["stops"] == []
