"""Goals by robotctl: stored, listed, answered by the planner."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest

from keyexpr_schema.keyspace import (
    GOAL_SPEC,
    GOAL_STATUS,
    PLANNER_ALIVE,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress, GoalState, GoalStatus
from keyexpr_schema.payloads.system import PlannerAliveAddress
from keyexpr_schema.payloads.waits import WaitKind, WaitReason
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from tests.support.robotctl import Robotctl

MakeConfig = Callable[..., SessionConfig]


def test_a_goal_without_a_planner_is_stored_and_said_so(robotctl: Robotctl) -> None:
    text = "Bring the first cup to the hallway."
    said = robotctl("goal", "add", text, "--priority", "2")
    assert said.code == 0
    assert "No planner is running" in said.out
    again = robotctl("goal", "add", text, "--json").data
    assert again["goal"] == "bring-the-first-cup-to-the-hallway-2"
    rows = robotctl("goal", "list", "--json").data
    assert [row["spec"]["ordinal"] for row in rows] == [1, 2]
    assert [row["spec"]["priority"] for row in rows] == [2, 0]
    assert rows[0]["status"] is None
    assert "waiting" in robotctl("goal", "show", rows[0]["goal"]).out
    assert "use another --id" in robotctl("goal", "add", "x", "--id", rows[0]["goal"]).err
    assert robotctl("goal", "delete", rows[0]["goal"]).code == 0
    assert "known are: bring-the-first-cup-to-the-hallway-2" in robotctl("goal", "show", "x").err
    # Nothing of it can stand in a key; a planner with a language model may understand it.
    assert robotctl("goal", "add", "把杯子拿到走廊", "--json").data["goal"] == "goal"
    assert (
        robotctl("goal", "add", "把杯子拿到走廊", "--json").data["goal"] == "goal-5"
    )  # a refused one has had 3


def test_when_a_goal_is_due_is_said_as_a_time_or_in_seconds(robotctl: Robotctl) -> None:
    text = "Bring the first cup to the hallway."
    for option, value in (("--due", "2h"), ("--within-s", "7200")):
        spec = robotctl("goal", "add", text, option, value, "--json").data["spec"]
        assert spec["due_s"] - spec["said_s"] == 7200.0
    both = robotctl("goal", "add", text, "--due", "2h", "--within-s", "5")
    assert both.code == 1 and both.err == "Error: say either --within-s or --due\n"


def test_what_a_goal_keeps_avoids_and_puts_in_order_is_shown(robotctl: Robotctl) -> None:
    said = robotctl(
        *("goal", "add", "Bring the first cup to the hallway.", "--id", "g", "--json"),
        *("--always", "at cup_2 kitchen", "--never", "at(hsr) = living_room"),
        *("--before", "at cup_1 living_room before at(cup_1) = hallway"),
    )
    (row,) = said.data["spec"]["sometime_before"]
    assert row["first"]["value"] == "living_room"
    assert row["then"]["value"] == "hallway"
    page = robotctl("goal", "show", "g").out
    assert "always      at(cup_2) = kitchen" in page
    assert "never       at(hsr) = living_room" in page
    assert "in order    at(cup_1) = living_room before at(cup_1) = hallway" in page


async def test_goals_are_waited_for_until_they_end_or_are_deleted(
    robotctl: Robotctl, session_config: MakeConfig
) -> None:
    stand = {
        "done": GoalState.REACHED,
        "kept": GoalState.STANDING,
        "failed": GoalState.FAILED,
        "runs": GoalState.RUNNING,
    }
    async with open_session(session_config(component="planner")) as session:
        for name, state in stand.items():
            await session.confirm(GOAL_SPEC, GoalAddress(name), Goal(goal=name, text=name))
            status = GoalStatus(goal=name, state=state, reason="no finger")
            await session.confirm(GOAL_STATUS, GoalAddress(name), status)
        idle = GoalStatus(
            goal="idle",
            state=GoalState.WAITING,
            waits_for=(WaitReason(kind=WaitKind.NO_PLAN),),
        )
        await session.confirm(GOAL_SPEC, GoalAddress("idle"), Goal(goal="idle", text="idle"))
        await session.confirm(GOAL_STATUS, GoalAddress("idle"), idle)
        run = GoalStatus(goal="cups.1", state=GoalState.REACHED, part_of="cups")
        await session.confirm(GOAL_STATUS, GoalAddress(run.goal), run)
        over = await robotctl.soon("goal", "wait", "done", "kept", "cups.1")
        failed = await robotctl.soon("goal", "wait", "done", "failed", "--json")
        late = await robotctl.soon("goal", "wait", "runs", "idle", "--timeout-s", "0.1")
        waiting = asyncio.create_task(robotctl.soon("goal", "wait", "runs"))
        await session.delete(GOAL_SPEC, GoalAddress("runs"))
        await session.delete(GOAL_STATUS, GoalAddress("runs"))
        deleted = await waiting
    assert over.out == "goal done is reached\ngoal kept is standing\ngoal cups.1 is reached\n"
    assert (over.code, failed.code, failed.out, late.code) == (0, 1, "", 1)
    assert "goal failed failed: no finger" in failed.err
    assert late.err.count("goal idle waits, and nobody has asked for a plan") == 1
    assert "no planner is running" in late.err and over.err == ""
    assert "waited 0.1 s for runs, idle to end (`robotctl why` tells what for), in vain" in late.err
    assert deleted.code == 1
    assert "was deleted meanwhile" in deleted.err or "there is no goal 'runs'" in deleted.err


def test_numbers_of_goals_do_not_come_back(robotctl: Robotctl) -> None:
    text = "Bring the first cup to the hallway."
    goals = [robotctl("goal", "add", text, "--json").data["goal"] for _ in range(3)]
    for goal in goals[1:]:
        assert robotctl("goal", "delete", goal).code == 0
    again = robotctl("goal", "add", text, "--json").data["goal"]
    assert again == "bring-the-first-cup-to-the-hallway-4"
    first, last = (row["spec"] for row in robotctl("goal", "list", "--json").data)
    assert (first["ordinal"], last["ordinal"]) == (1, 4)
    assert last["said_s"] > first["said_s"]


async def _answer_goals(session: Session, state: GoalState, reason: str | None) -> None:
    """What a planner says of every goal, and no more."""
    async with session.watch(GOAL_SPEC) as watch:
        async for change in watch:
            if change.value is not None:
                status = GoalStatus(goal=change.address.goal, state=state, reason=reason)
                await session.confirm(GOAL_STATUS, GoalAddress(change.address.goal), status)


@pytest.mark.parametrize(
    ("state", "reason", "code"),
    [
        (GoalState.REJECTED, "nobody knows what a unicorn is", 1),
        (GoalState.WAITING, None, 0),
    ],
)
async def test_a_goal_is_answered_by_the_planner(
    robotctl: Robotctl,
    session_config: MakeConfig,
    state: GoalState,
    reason: str | None,
    code: int,
) -> None:
    async with (
        open_session(session_config(component="planner")) as session,
        session.token(PLANNER_ALIVE, PlannerAliveAddress("run1")),
    ):
        answering = asyncio.create_task(_answer_goals(session, state, reason))
        try:
            said = await robotctl.soon("goal", "add", "Bring the unicorn here.", "--id", "g1")
        finally:
            answering.cancel()
    assert said.code == code
    if reason:
        assert said.err.strip() == f"Error: goal g1 rejected: {reason}"
    else:
        assert "goal g1 is waiting" in said.out
