"""`robotctl health` says within its time whether a process is well, whatever has become of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace
from typer.testing import CliRunner

from cli.client.health_checks import Asked, look
from cli.commands.health import health
from keyexpr_schema.keyspace import (
    DIAGNOSTIC,
    PLANNER_ALIVE,
    PLANNER_STATUS,
    RECORDER_ALIVE,
    ROBOT_ALIVE,
    ROBOT_SPEC,
    ROBOT_STATE,
    SIM_ALIVE,
)
from keyexpr_schema.payloads.robots import AliveAddress, RobotActivity, RobotAddress, RobotState
from keyexpr_schema.payloads.simulation import SimAliveAddress
from keyexpr_schema.payloads.system import (
    Diagnostic,
    DiagnosticAddress,
    PlannerAddress,
    PlannerAliveAddress,
    PlannerStatus,
    RecorderAliveAddress,
)
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from sim.files.robot_file import load_robot
from tests.support.planner_process import planner
from tests.support.polling import until
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess

MakeConfig = Callable[..., SessionConfig]


async def becomes(session: Session, line: str, *asked: str, store: bool = True) -> str:
    """The line, as soon as it begins so: on a busy machine what is asked is late now and then."""

    async def so() -> str | None:
        told, _ = await said(session, *asked, store=store)
        return told if told.startswith(line) else None

    found: str = await until(so, line)
    return found


async def said(session: Session, *asked: str, store: bool = True) -> tuple[str, bool]:
    """The line, and whether it helps to start it again."""
    role, *robots = asked or (None,)
    verdict = await look(session, Asked(role, tuple(map(str, robots)), store))
    assert verdict.line.startswith("well: " if verdict.well else "NOT WELL: ")
    return verdict.line, verdict.restart_helps


def test_the_command_ends_in_time_whatever_the_router_does(
    robotctl: Robotctl, router: RouterProcess
) -> None:
    done = robotctl("health", "router")
    assert (done.code, done.out) == (0, f"well: the store answers at {router.endpoint}\n")
    router.freeze()
    try:
        # Who is frozen takes connections and answers nothing; Zenoh waits for it.
        frozen = robotctl("health", "router", "--timeout", "1")
        assert (frozen.code, frozen.err) == (1, "")
        assert frozen.out.startswith("NOT WELL: ")
    finally:
        router.thaw()
    router.stop()
    # A worker is not started again because the line to its router is cut; a router is.
    cut = robotctl("health", "worker", "hsr", "--live", "--json", "--timeout", "1")
    assert (cut.code, cut.data["well"]) == (0, False)
    assert robotctl("health", "router", "--live", "--timeout", "1").code == 1


async def test_workers_are_well_while_they_are_connected_and_can_work(
    router: RouterProcess, session_config: MakeConfig
) -> None:
    address = RobotAddress("hsr")
    async with open_session(session_config(component="hsr")) as session:
        assert await said(session, "worker", "hsr") == (
            "NOT WELL: hsr is not registered, and a worker of it waits for that",
            False,
        )
        await session.confirm(ROBOT_SPEC, address, load_robot("hsr"))
        away = ("NOT WELL: the worker of hsr is not connected", True)
        assert await said(session, "worker") == away
        assert await said(session, "worker", "hsr") == away
        async with session.token(ROBOT_ALIVE, AliveAddress("hsr", "run1")):
            state = RobotState(robot="hsr", incarnation="run1", activity=RobotActivity.IDLE)
            await session.confirm(ROBOT_STATE, address, state)
            await becomes(session, "well: the worker of hsr is connected, idle", "worker", "hsr")
            await session.confirm(ROBOT_STATE, address, replace(state, trouble="no room"))
            # To start it again makes none.
            assert await said(session, "worker", "hsr") == ("NOT WELL: hsr: no room", False)


async def test_a_planner_is_well_when_it_is_in_charge_and_answers(
    router: RouterProcess, session_config: MakeConfig, tmp_path: Path
) -> None:
    async with open_session(session_config(realm="test", component="other")) as session:
        assert await said(session, "planner") == ("NOT WELL: no planner is connected", True)
        async with session.token(PLANNER_ALIVE, PlannerAliveAddress("run1")):
            line, _ = await said(session, "planner")
            assert line == "NOT WELL: a planner is connected, and is not in charge"
            status = PlannerStatus(epoch=1, incarnation="run1")
            await session.confirm(PLANNER_STATUS, PlannerAddress(), status)
            line, _ = await said(session, "planner")
            assert line == "NOT WELL: the planner is connected, and does not answer"
        async with planner(router.endpoint, tmp_path / "planner"):
            await becomes(
                session, "well: the planner is in charge (epoch 2) and answers", "planner"
            )
            line = await becomes(session, "well: the store answers at ")
            assert line.endswith("; no robot is registered")
            wrong = Diagnostic(component="planner", check="x", sentence="no room", since_s=1.0)
            await session.confirm(DIAGNOSTIC, DiagnosticAddress("planner", "x"), wrong)
            assert await said(session) == ("NOT WELL: no room", False)


async def test_recorder_and_world_are_well_while_they_are_connected(
    router: RouterProcess, session_config: MakeConfig
) -> None:
    async with open_session(session_config(component="both")) as session:
        assert await said(session, "recorder") == ("NOT WELL: no recorder is connected", True)
        assert await said(session, "sim") == ("NOT WELL: no simulated world is connected", True)
        async with (
            session.token(RECORDER_ALIVE, RecorderAliveAddress("r1")),
            session.token(SIM_ALIVE, SimAliveAddress("s1")),
        ):
            await becomes(session, "well: the recorder is connected", "recorder")
            await becomes(session, "well: the simulated world is connected", "sim")
            line = f"well: the router at {router.endpoint} answers"
            await becomes(session, line, "router", store=False)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["plannr"], "did you mean 'planner'?"),
        (["planner", "hsr"], "only workers are of robots"),
        (["planner", "--no-store"], "--no-store is of a router"),
    ],
)
def test_what_is_asked_must_make_sense(words: list[str], sentence: str) -> None:
    wrong = CliRunner().invoke(health, words)
    assert (wrong.exit_code, wrong.stdout) == (1, "")
    assert sentence in wrong.stderr
