"""Robots by robotctl: registered, listed, forgotten, connected."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from keyexpr_schema.keyspace import (
    FACT,
    HOLD,
    PLANNER_ALIVE,
    PLANNER_STATUS,
    ROBOT_ALIVE,
    ROBOT_SPEC,
    ROBOT_STATE,
)
from keyexpr_schema.payloads.robots import AliveAddress, RobotActivity, RobotAddress, RobotState
from keyexpr_schema.payloads.system import PlannerAddress, PlannerAliveAddress, PlannerStatus
from keyexpr_schema.payloads.world import FactAddress
from keyexpr_schema.transport.session import SessionConfig, open_session
from tests.support.household import fact
from tests.support.robotctl import Robotctl

CONFIGS = Path(__file__).parents[3] / "configs"
ROBOTS = [str(CONFIGS / "robots" / f"{name}.yaml") for name in ("hsr", "locobot")]
MakeConfig = Callable[..., SessionConfig]


def test_robots_are_registered_listed_and_forgotten(robotctl: Robotctl) -> None:
    assert robotctl("robots").out.strip() == "No robots are registered."
    told = robotctl("register", *ROBOTS)
    assert told.code == 0
    assert "registered locobot, which can navigate, search" in told.out
    rows = robotctl("robots", "--json").data
    assert [row["robot"] for row in rows] == ["hsr", "locobot"]
    assert not any(row["connected"] for row in rows)
    assert rows[0]["spec"]["capabilities"]["grip"] == 1.2
    assert robotctl("--json", "robots").data == rows

    wrong = robotctl("unregister", "hrs")
    assert wrong.code == 1
    assert wrong.err.strip() == (
        "Error: there is no robot 'hrs' (did you mean 'hsr'?); known are: hsr, locobot"
    )
    assert robotctl("unregister", "hsr").code == 0
    assert [row["robot"] for row in robotctl("robots", "--json").data] == ["locobot"]


FACTS_OF_HSR = (
    ("hsr", "at", "kitchen"),
    ("hsr", "holding", "cup_1"),
    ("cup_1", "at", "hsr"),
)


async def test_who_is_connected_shows(robotctl: Robotctl, session_config: MakeConfig) -> None:
    await robotctl.soon("register", *ROBOTS)
    async with (
        open_session(session_config(component="hsr")) as session,
        session.token(ROBOT_ALIVE, AliveAddress("hsr", "run1")),
    ):
        state = RobotState(
            robot="hsr",
            incarnation="run1",
            activity=RobotActivity.BUSY,
            place="kitchen",
            holding="cup_1",
            plan="p1",
            task="t2",
        )
        await session.confirm(ROBOT_STATE, RobotAddress("hsr"), state)
        rows = (await robotctl.soon("robots", "--json")).data
        assert {row["robot"]: row["connected"] for row in rows} == {"hsr": True, "locobot": False}
        line = next(
            line for line in (await robotctl.soon("robots")).out.splitlines() if "hsr" in line
        )
        assert line.split()[:6] == ["hsr", "yes", "busy", "kitchen", "cup_1", "p1/t2"]

        for subject, relation, word in FACTS_OF_HSR:
            known = fact(subject, relation, word)
            await session.confirm(FACT, FactAddress.of(known.key), known)
        loaded = await robotctl.soon("unregister", "hsr")
        assert loaded.code == 1 and "hsr has cup_1 with it; `robotctl drain hsr`" in loaded.err
        assert not await session.list(HOLD), "nothing has happened"
        forced = await robotctl.soon("unregister", "hsr", "--force", "--wait", "0", "--as", "ana")
        assert (forced.code, forced.out) == (0, "unregistered hsr\n")
        assert "NOT CONFIRMED: hsr: its worker has not said that it rests" in forced.err
        assert "nobody knows where cup_1 is" in forced.err
        left = [(f.subject, f.value, f.by) for f in (await session.list(FACT)).values()]
        assert left == [("cup_1", None, "ana")]
        assert not await session.list(HOLD) and not await session.list(ROBOT_STATE)
        assert [a.robot for a in await session.list(ROBOT_SPEC)] == ["locobot"]


async def test_a_robot_with_a_skill_that_no_planner_models_is_not_registered(
    robotctl: Robotctl, session_config: MakeConfig, tmp_path: Path
) -> None:
    wrong = tmp_path / "r.yaml"
    wrong.write_text("robot: r\nmodel: hsr\nskills: [navigate, serch]\ncapabilities: {drive: 1}\n")
    assert (await robotctl.soon("register", str(wrong))).code == 0  # nobody can tell
    assert (await robotctl.soon("unregister", "r")).code == 0
    async with open_session(session_config(component="planner")) as session:
        dead = PlannerStatus(epoch=1, incarnation="run0", skills=("navigate",))
        await session.confirm(PLANNER_STATUS, PlannerAddress(), dead)
        # One that is dead has no say in what the next can do.
        assert (await robotctl.soon("register", str(wrong))).code == 0
        assert (await robotctl.soon("unregister", "r")).code == 0
        status = PlannerStatus(
            epoch=2,
            incarnation="run1",
            planners=("symbolic",),
            strategies=("big-dag",),
            allocators=("milp",),
            skills=("charge", "navigate", "search"),
        )
        async with session.token(PLANNER_ALIVE, PlannerAliveAddress("run1")):
            # It has just begun: what it says comes a moment later.
            asking = asyncio.create_task(robotctl.soon("register", ROBOTS[1], str(wrong)))
            await session.confirm(PLANNER_STATUS, PlannerAddress(), status)
            said = await asking
        assert said.code == 1
        assert said.err.strip() == (
            "Error: robot 'r': the planner knows no skill 'serch' (did you mean 'search'?); "
            "it knows charge, navigate, search; teach it more with `robotctl planner --skills FILE`"
        )
        assert await session.list(ROBOT_SPEC) == {}
        page = (await robotctl.soon("status")).out
        assert "planner  not running" in page


def test_a_second_robot_of_the_same_file(robotctl: Robotctl) -> None:
    assert robotctl("world", "add", "--object", "cup_1", "--kind", "cup").code == 0
    assert robotctl("--as", "ana", "register", ROBOTS[0], "--as", "hsr_2").code == 0
    assert robotctl("register", ROBOTS[0]).code == 0
    rows = robotctl("robots", "--json").data
    assert [(row["robot"], row["spec"]["model"]) for row in rows] == [
        ("hsr", "hsr"),
        ("hsr_2", "hsr"),
    ]
    assert rows[1]["spec"]["by"] == "ana"
    for arguments, words in (
        ((*ROBOTS, "--as", "x"), "--as is the name of one robot"),
        ((ROBOTS[0], ROBOTS[0]), "two of the files are of a robot 'hsr'"),
        ((ROBOTS[0], "--as", "cup_1"), "'cup_1' is an object already"),
    ):
        wrong = robotctl("register", *arguments)
        assert wrong.code == 1
        assert words in wrong.err


async def test_workers_of_all_that_have_none(
    robotctl: Robotctl, session_config: MakeConfig
) -> None:
    assert "no robot to work for" in (await robotctl.soon("worker", "--all")).err
    assert "one of both" in (await robotctl.soon("worker")).err
    await robotctl.soon("register", *ROBOTS)
    async with open_session(session_config(component="both")) as session:
        async with (
            session.token(ROBOT_ALIVE, AliveAddress("hsr", "run1")),
            session.token(ROBOT_ALIVE, AliveAddress("locobot", "run1")),
        ):
            assert (
                "has a worker already: hsr, locobot" in (await robotctl.soon("worker", "--all")).err
            )
        async with session.token(ROBOT_ALIVE, AliveAddress("hsr", "run1")):
            # It is turned away only where it begins: it is the worker of the other one.
            said = await robotctl.soon("worker", "--all", "--data", "/dev/null/not-a-folder")
            assert said.out.splitlines()[0] == "workers of locobot"
