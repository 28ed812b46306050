"""`robotctl stop` and `resume`, where nobody is there to obey."""

from __future__ import annotations

import asyncio
from pathlib import Path
from resource import RLIMIT_FSIZE, prlimit

from keyexpr_schema.keyspace import ROBOT_ALIVE, ROBOT_STATE, STOP
from keyexpr_schema.payloads.robots import AliveAddress, RobotActivity, RobotAddress, RobotState
from keyexpr_schema.transport.session import SessionConfig, open_session
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess

CONFIGS = Path(__file__).parents[3] / "configs"
ROBOTS = [str(CONFIGS / "robots" / f"{name}.yaml") for name in ("hsr", "locobot")]


def test_who_has_not_confirmed_is_named_and_a_stop_stands_until_it_is_lifted(
    robotctl: Robotctl,
) -> None:
    nobody = robotctl("stop", "--all", "--wait", "0")
    assert nobody.code == 1 and "NOBODY IS IN REACH" in nobody.err and "robotfleet" in nobody.err
    assert robotctl("resume", "--all").code == 0
    robotctl("register", *ROBOTS)
    stopped = robotctl("stop", "--all", "--why", "smoke", "--as", "ana", "--wait", "0.1", "--json")
    assert stopped.code == 1
    assert stopped.data["confirmed"] == []
    assert stopped.data["unconfirmed"] == {
        "hsr": "its worker is not connected",
        "locobot": "its worker is not connected",
    }
    first = stopped.data["stop"]["stop"]
    again = robotctl("stop", "hsr", "--as", "bob", "--wait", "0")
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


async def test_a_stop_that_the_store_has_no_room_for_is_obeyed_and_told_and_can_be_ended(
    router: RouterProcess, robotctl: Robotctl
) -> None:
    config = SessionConfig(endpoints=(router.endpoint,), realm="robotfleet", component="worker")
    async with (
        open_session(config) as worker,
        worker.token(ROBOT_ALIVE, AliveAddress("hsr", "i1")),
        worker.watch(STOP) as stops,
    ):
        await stops.synced()
        limits = prlimit(router.pid, RLIMIT_FSIZE)
        prlimit(router.pid, RLIMIT_FSIZE, (0, limits[1]))
        giving = asyncio.create_task(robotctl.soon("stop", "--robot", "hsr", "--wait", "60"))
        heard = await anext(aiter(stops))
        at, stop = RobotAddress("hsr"), heard.address.stop
        rests = RobotState(
            robot="hsr", incarnation="i1", activity=RobotActivity.IDLE, stops=(stop,)
        )
        worker.put(ROBOT_STATE, at, rests)
        given = await giving
        assert given.out.startswith("hsr rests\n") and given.code == 1
        assert "NOT STORED: who is started again does not know of it: stops/" in given.err
        prlimit(router.pid, RLIMIT_FSIZE, limits)
        await worker.confirm(ROBOT_STATE, at, rests)
        shown = " ".join((await robotctl.soon("status")).out.split())
        assert f"hsr rests by emergency stop {stop}, which is not stored" in shown
        ended = await robotctl.soon("resume", "--all")
        assert ended.out == f"{stop} lifted\n"
        gone = await anext(aiter(stops))
        assert gone.value is None and gone.address == heard.address


def test_it_says_whom(robotctl: Robotctl, tmp_path: Path) -> None:
    robotctl("register", *ROBOTS)
    for command in ("stop", "resume"):
        for wrong in ([], ["--all", "--robot", "hsr"]):
            done = robotctl(command, *wrong)
            assert done.code == 2 and "say either --all" in done.err
    unknown = robotctl("stop", "--robot", "hrs")
    assert unknown.code == 1
    assert "there is no robot 'hrs' (did you mean 'hsr'?)" in unknown.err
    alone = Robotctl("tcp/127.0.0.1:1", tmp_path)("stop", "--all")
    assert alone.code == 1 and "NOBODY IS STOPPED by this: no router answers" in alone.err
    assert robotctl("status", "--json").data["stops"] == []


def test_pauses_and_drains_are_listed_and_each_ends_by_itself(robotctl: Robotctl) -> None:
    robotctl("register", *ROBOTS)
    whole = robotctl("pause", "--all", "--as", "ana", "--why", " lunch\n")
    assert (whole.code, whole.out) == (0, "the whole fleet: paused by ana (lunch)\n")
    assert robotctl("pause", "--robot", "hsr", "--as", "bob").out == "hsr: paused by bob\n"
    again = robotctl("pause", "--robot", "hsr", "--as", "bob")
    assert (again.code, again.out) == (0, "hsr: paused by bob, as it was already\n")
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
    assert unknown.code == 1 and "there is no ongoing plan 'plan-7'" in unknown.err
    for words in ("pause", "resume"):
        meant = robotctl(words, "hsr")
        assert (meant.code, meant.out) == (1, "") and meant.err.endswith("say --robot hsr\n")
    robot = robotctl("why", "hsr")
    assert robot.code == 1 and "hsr is a robot: `robotctl status --robot hsr`" in robot.err
