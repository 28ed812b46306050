"""Robots by robotctl: registered, listed, forgotten, connected."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cli.commands.robots import register
from keyexpr_schema.keyspace import (
    FACT,
    HOLD,
    OBJECT,
    PLANNER_ALIVE,
    PLANNER_STATUS,
    ROBOT_ALIVE,
    ROBOT_SPEC,
    ROBOT_STATE,
)
from keyexpr_schema.payloads.robots import AliveAddress, RobotActivity, RobotAddress, RobotState
from keyexpr_schema.payloads.system import PlannerAddress, PlannerAliveAddress, PlannerStatus
from keyexpr_schema.payloads.world import FactAddress, Object, ObjectAddress
from keyexpr_schema.transport.session import SessionConfig, open_session
from sim.files.robot_file import load_robot
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
    alone = robotctl("robots", "hsr", "--json").data
    assert [row["robot"] for row in alone] == ["hsr"]
    nobody = robotctl("robots", "hrs")
    assert nobody.code == 1 and "there is no robot 'hrs' (did you mean 'hsr'?)" in nobody.err
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


async def test_a_second_robot_of_the_same_file(
    robotctl: Robotctl, session_config: MakeConfig
) -> None:
    cup = Object(object="cup_1", kind="cup", label="cup")
    async with open_session(session_config(component="test")) as session:
        await session.confirm(OBJECT, ObjectAddress("cup_1"), cup)
        said = await robotctl.soon("--as", "ana", "register", ROBOTS[0], "--as", "hsr_2")
        assert said.out.startswith("registered hsr_2, which can ")
        taken = await robotctl.soon("register", ROBOTS[0], "--as", "cup_1")
        assert "'cup_1' is an object already" in taken.err
        specs = {a.robot: spec for a, spec in (await session.list(ROBOT_SPEC)).items()}
    assert {name: (spec.model, spec.by) for name, spec in specs.items()} == {
        "hsr_2": ("hsr", "ana")
    }


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((*ROBOTS, "--as", "x"), "--as is the name of one robot"),
        ((ROBOTS[0], ROBOTS[0]), "two of the files are of a robot 'hsr'"),
    ],
)
def test_names_of_robots_that_would_clash_are_refused(
    arguments: tuple[str, ...], words: str
) -> None:
    wrong = CliRunner().invoke(register, list(arguments))
    assert wrong.exit_code == 1
    assert words in wrong.stderr


async def test_workers_of_all_that_have_none(
    robotctl: Robotctl, session_config: MakeConfig
) -> None:
    specs = [load_robot(file) for file in ROBOTS]
    async with open_session(session_config(component="both")) as session:
        for spec in specs:
            await session.confirm(ROBOT_SPEC, RobotAddress(spec.robot), spec)
        async with session.token(ROBOT_ALIVE, AliveAddress("hsr", "run1")):
            # It is turned away only where it begins: it is the worker of the other one.
            said = await robotctl.soon("worker", "--all", "--data", "/dev/null/not-a-folder")
            assert said.out.splitlines()[0] == "workers of locobot"
            async with session.token(ROBOT_ALIVE, AliveAddress("locobot", "run1")):
                none = await robotctl.soon("worker", "--all")
    assert "every robot has a worker already: hsr, locobot" in none.err
