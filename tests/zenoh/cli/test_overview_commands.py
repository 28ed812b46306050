"""The whole fleet by robotctl: status, watch, journal; one realm and no other."""

from __future__ import annotations

import asyncio
import json
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import zenoh

from keyexpr_schema.keyspace import (
    DIAGNOSTIC,
    GOAL_SPEC,
    GOAL_STATUS,
    ROBOT_ALIVE,
    UNDECODABLE,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress, GoalState, GoalStatus
from keyexpr_schema.payloads.robots import AliveAddress
from keyexpr_schema.payloads.system import Diagnostic, DiagnosticAddress
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.session import SessionConfig, open_session
from tests.support.child_process import child_process
from tests.support.polling import DEADLINE_S
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess

CONFIGS = Path(__file__).parents[3] / "configs"
ROBOTS = [str(CONFIGS / "robots" / f"{name}.yaml") for name in ("hsr", "locobot")]
MakeConfig = Callable[..., SessionConfig]
BLOCK = zenoh.CongestionControl.BLOCK
"""Else Zenoh leaves out what a busy machine has no time for."""


def test_empty_lists_are_lists(robotctl: Robotctl) -> None:
    for arguments in (["robots"], ["goal", "list"], ["plan", "list"], ["task", "list"]):
        assert robotctl(*arguments, "--json").data == []
        assert robotctl(*arguments).code == 0
    nobody = robotctl("watch", "nope")
    assert nobody.code == 1 and "there is no plan 'nope'" in nobody.err
    status = robotctl("status", "--json").data
    assert status["planner"] == {"running": False, "status": None}
    assert "not running" in robotctl("status").out


def test_the_journal_tells_what_was_stored_in_order(robotctl: Robotctl) -> None:
    robotctl("register", *ROBOTS)
    robotctl("unregister", "hsr")
    told = robotctl("journal", "--json").data
    specs = [(e["keyexpr"], e["deleted"]) for e in told["entries"] if "/spec" in e["keyexpr"]]
    assert specs == [
        ("robots/hsr/spec", False),
        ("robots/locobot/spec", False),
        ("robots/hsr/spec", True),
    ]
    last = told["entries"][-1]["number"]
    assert robotctl("journal", "--after", str(last), "--json").data["entries"] == []
    (newest,) = robotctl("journal", "--limit", "1", "--json").data["entries"]
    assert newest["number"] == last
    (first,) = robotctl("journal", "--after", "0", "--limit", "1", "--json").data["entries"]
    assert first["number"] == 1
    of_one = robotctl("journal", "--key", "robots/locobot/*", "--json").data["entries"]
    assert [e["keyexpr"] for e in of_one] == ["robots/locobot/spec"]
    assert len(robotctl("journal", "--since", "1h", "--json").data["entries"]) == last
    shown = robotctl("journal", "--since", "1h", "--key", "robots/hsr/**").out.splitlines()
    assert "deleted" in shown[-1]
    bad = robotctl("journal", "--key", "goals//spec")
    assert (bad.code, "--key 'goals//spec' is no pattern of keys" in bad.err) == (1, True)
    bad = robotctl("journal", "--since", "yesterday")
    assert (bad.code, "neither a time" in bad.err) == (1, True)


def interruptible(robotctl: Robotctl) -> dict[str, Any]:
    """Options of a process that can be interrupted, and says at once what it says.

    What runs in the background of a shell has SIGINT ignored, and hands that on.
    """
    return {
        "env": {**robotctl.env, "PYTHONUNBUFFERED": "1"},
        "preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    }


@pytest.mark.parametrize("flags", [[], ["--json"]])
async def test_the_journal_is_followed_through_a_restart_of_the_router(
    robotctl: Robotctl, router: RouterProcess, session_config: MakeConfig, flags: list[str]
) -> None:
    async with open_session(session_config()) as session:
        for name in ("g1", "g2", "g3"):
            await session.confirm(GOAL_SPEC, GoalAddress(name), Goal(goal=name, text="Bring it."))
        command = ("-m", "cli.main", "journal", "--tail", "--limit", "2", "--key", "goals/*/spec")
        async with (
            child_process(sys.executable, *command, *flags, **interruptible(robotctl)) as child,
            asyncio.timeout(DEADLINE_S),
        ):
            assert child.stdout is not None
            lines = [(await child.stdout.readline()).decode() for _ in range(2)]
            router.restart()
            status = GoalStatus(goal="g4", state=GoalState.WAITING)
            await session.confirm(GOAL_STATUS, GoalAddress("g4"), status, DEADLINE_S)
            await session.delete(GOAL_SPEC, GoalAddress("g1"), DEADLINE_S)
            lines.append((await child.stdout.readline()).decode())
            child.send_signal(signal.SIGINT)
            assert await child.wait() == 130
    if flags:
        entries = [json.loads(line) for line in lines]
        assert [e["keyexpr"][6:8] for e in entries] == ["g2", "g3", "g1"]
    else:
        assert [f"goals/g{n}/spec" in line for n, line in zip("231", lines, strict=True)] == [
            True
        ] * 3
        assert "deleted" in lines[-1]


async def test_status_tells_what_is_unreadable_as_long_as_it_is(
    robotctl: Robotctl, router: RouterProcess, session_config: MakeConfig
) -> None:
    async with open_session(session_config(component="planner")) as session:
        bad = zenoh_config("client", connect=[router.endpoint], namespace="robotfleet")
        with await asyncio.to_thread(zenoh.open, bad) as foreign:
            foreign.put("goals/g1/spec", b"{}", congestion_control=BLOCK)
            foreign.put("goals/g2/spec", b"{}", congestion_control=BLOCK)
            foreign.put("planner/status", b"nonsense", congestion_control=BLOCK)
            await asyncio.to_thread(lambda: list(foreign.get("goals/g1/spec")))  # it is behind them
        async with session.watch(GOAL_SPEC, UNDECODABLE) as watch:
            seen: set[str] = set()
            async for change in watch:
                if change.key is UNDECODABLE and change.value is not None:
                    seen.add(change.value.keyexpr)
                if {"goals/g1/spec", "goals/g2/spec"} <= seen:
                    break
        status = (await robotctl.soon("status", "--json")).data
        assert {"goals/g1/spec", "goals/g2/spec"} <= {r["keyexpr"] for r in status["rejects"]}
        await session.confirm(GOAL_SPEC, GoalAddress("g1"), Goal(goal="g1", text="Bring the cup."))
        await session.delete(GOAL_SPEC, GoalAddress("g2"))
        status = (await robotctl.soon("status", "--json")).data
        assert {r["keyexpr"] for r in status["rejects"]} <= {"planner/status"}


async def test_status_shows_what_is_wrong_with_the_planner(
    robotctl: Robotctl, session_config: MakeConfig
) -> None:
    """A value that decodes and could not be used is shown for as long as it is there."""
    goal = Goal(goal="g1", text="Bring the cup.")
    wrong = Diagnostic(
        component="planner", check="store", sentence="the planner cannot read", since_s=0.0
    )
    at = DiagnosticAddress("planner", "store")
    async with open_session(session_config(component="planner")) as session:
        await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal)
        await session.confirm(DIAGNOSTIC, at, wrong)
        session.report_unusable(GOAL_SPEC, GoalAddress("g1"), goal, "it breaks the core")
        status = (await robotctl.soon("status", "--json")).data
        assert [r["reason"] for r in status["rejects"]] == ["it breaks the core"]
        assert [d["sentence"] for d in status["diagnostics"]] == ["the planner cannot read"]
        page = (await robotctl.soon("status")).out
        assert "planner: the planner cannot read" in page and "it breaks the core" in page
        await session.delete(DIAGNOSTIC, at)
        await session.confirm(GOAL_SPEC, GoalAddress("g1"), Goal(goal="g1", text="Bring it."))
        status = (await robotctl.soon("status", "--json")).data
        assert status["rejects"] == status["diagnostics"] == []


@pytest.mark.parametrize("flags", [[], ["--json"]])
async def test_watch_tells_each_change_until_it_is_interrupted(
    robotctl: Robotctl, session_config: MakeConfig, flags: list[str]
) -> None:
    async with open_session(session_config(component="planner")) as session:
        await session.confirm(
            GOAL_STATUS, GoalAddress("g1"), GoalStatus(goal="g1", state=GoalState.WAITING)
        )
        command = ("-m", "cli.main", "watch", *flags)
        async with (
            child_process(sys.executable, *command, **interruptible(robotctl)) as child,
            asyncio.timeout(DEADLINE_S),
        ):
            assert child.stdout is not None and child.stderr is not None
            stored = (await child.stdout.readline()).decode()
            await session.confirm(
                GOAL_STATUS, GoalAddress("g1"), GoalStatus(goal="g1", state=GoalState.REACHED)
            )
            changed = (await child.stdout.readline()).decode()
            async with session.token(ROBOT_ALIVE, AliveAddress("hsr", "i1")):
                came = (await child.stdout.readline()).decode()
            gone = (await child.stdout.readline()).decode()
            child.send_signal(signal.SIGINT)
            code = await child.wait()
            complaints = (await child.stderr.read()).decode()
    if flags:
        assert json.loads(stored)["value"]["state"] == "waiting"
        assert json.loads(changed)["key"] == "goals/g1/status"
        assert json.loads(came) == {"key": "robots/hsr/alive/i1", "value": {}}
        assert json.loads(gone) == {"key": "robots/hsr/alive/i1", "value": None}
    else:
        assert "hsr is connected" in came and "hsr is away: its worker is not" in gone
        assert "goal g1 is waiting" in stored
        assert "goal g1 is reached" in changed
    assert code == 130
    assert complaints == ""


def test_fleets_of_different_realms_do_not_see_each_other(robotctl: Robotctl) -> None:
    assert robotctl("goal", "add", "Here.", "--realm", "one").code == 0
    assert robotctl("--realm", "two", "goal", "list", "--json").data == []
    assert len(robotctl("goal", "list", "--realm", "one", "--json").data) == 1
