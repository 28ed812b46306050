"""Robots by robotctl: registered, listed, forgotten, connected."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from keyexpr_schema.keyspace import (
    PLANNER_STATUS,
    ROBOT_ALIVE,
    ROBOT_SPEC,
    ROBOT_STATE,
)
from keyexpr_schema.payloads.robots import AliveAddress, RobotActivity, RobotAddress, RobotState
from keyexpr_schema.payloads.system import PlannerAddress, PlannerStatus
from keyexpr_schema.transport.session import SessionConfig, open_session
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


async def test_a_robot_with_a_skill_that_no_planner_models_is_not_registered(
    robotctl: Robotctl, session_config: MakeConfig, tmp_path: Path
) -> None:
    wrong = tmp_path / "r.yaml"
    wrong.write_text("robot: r\nmodel: hsr\nskills: [navigate, serch]\ncapabilities: {drive: 1}\n")
    assert (await robotctl.soon("register", str(wrong))).code == 0  # nobody can tell
    assert (await robotctl.soon("unregister", "r")).code == 0
    async with open_session(session_config(component="planner")) as session:
        status = PlannerStatus(
            epoch=1,
            incarnation="run1",
            planners=("symbolic",),
            strategies=("big-dag",),
            allocators=("milp",),
            skills=("navigate", "search"),
        )
        await session.confirm(PLANNER_STATUS, PlannerAddress(), status)
        said = await robotctl.soon("register", ROBOTS[1], str(wrong))
        assert said.code == 1
        assert said.err.strip() == (
            "Error: robot 'r': the planner knows no skill 'serch' (did you mean 'search'?); "
            "it knows navigate, search; teach it more with `robotctl planner --skills FILE`"
        )
        assert await session.list(ROBOT_SPEC) == {}
        page = (await robotctl.soon("status")).out
        assert "planner  not running" in page
