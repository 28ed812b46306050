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
    assert released.out == f"{first} holds locobot no longer\n", "it goes on for the other one"
    assert first in [stop["stop"] for stop in robotctl("status", "--json").data["stops"]]
    lifted = robotctl("resume", "--all", "--json").data
    assert len(lifted["lifted"]) == 2 and lifted["still_held"] == {}
    assert robotctl("status", "--json").data["stops"] == []
    assert robotctl("resume", "--all").out == "No stop and no pause stands there.\n"


def test_it_says_whom(robotctl: Robotctl) -> None:
    robotctl("register", *ROBOTS)
    for command in ("stop", "resume"):
        for wrong in ([], ["--all", "--robot", "hsr"]):
            done = robotctl(command, *wrong)
            assert done.code == 2 and "say either --all" in done.err
    unknown = robotctl("stop", "--robot", "hrs")
    assert unknown.code == 1
    assert "there is no robot 'hrs' (did you mean 'hsr'?)" in unknown.err
    assert robotctl("status", "--json").data["stops"] == []


def test_pauses_and_drains_are_listed_and_each_ends_by_itself(robotctl: Robotctl) -> None:
    robotctl("register", *ROBOTS)
    whole = robotctl("pause", "--all", "--as", "ana", "--why", " lunch\n")
    assert (whole.code, whole.out) == (0, "the whole fleet: paused by ana (lunch)\n")
    assert robotctl("pause", "--robot", "hsr", "--as", "bob").out == "hsr: paused by bob\n"
    drained = robotctl("drain", "hsr", "locobot", "hsr", "--as", "bob").out
    assert drained.splitlines() == ["hsr: drained by bob", "locobot: drained by bob"]
    shown = robotctl("status").out
    assert "the whole fleet: paused by ana (lunch)" in shown and "hsr: drained by bob" in shown
    also = robotctl("resume", "--robot", "locobot")
    assert also.code == 1
    assert "locobot is still held: the whole fleet: paused by ana (lunch)" in also.err
    assert robotctl("resume", "--all").out == "no longer: the whole fleet: paused by ana (lunch)\n"
    assert robotctl("return", "hsr").out == "no longer: hsr: drained by bob\n"
    left = [(h["kind"], h["robots"]) for h in robotctl("status", "--json").data["holds"]]
    assert sorted(left) == [("drain", ["locobot"]), ("pause", ["hsr"])]
    assert robotctl("return", "hsr").out == "hsr was not drained.\n"
    unknown = robotctl("pause", "plan-7")
    assert unknown.code == 1 and "there is no plan that goes on 'plan-7'" in unknown.err
