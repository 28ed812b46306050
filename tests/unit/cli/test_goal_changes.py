"""Which goals can be wanted again, or sooner."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from msgspec.structs import replace

from cli.client.fleet_view import FleetView
from cli.client.goal_changes import check_failed, check_open
from cli.client.planner_requests import have_planned
from cli.errors import Refused
from keyexpr_schema.payloads.goals import GoalState, GoalStatus
from keyexpr_schema.payloads.waits import WaitKind, WaitReason


@pytest.mark.parametrize(
    ("state", "instead"),
    [
        (GoalState.RUNNING, "it has not failed"),
        (GoalState.WAITING, "have it planned with `robotctl plan create`"),
        (GoalState.REACHED, "say it once more with `robotctl goal add`"),
        (GoalState.REJECTED, "say it in other words with `robotctl goal add`"),
    ],
)
def test_only_what_has_failed_is_wanted_again(state: GoalState, instead: str) -> None:
    known = {
        "g": GoalStatus(goal="g", state=GoalState.FAILED),
        "h": GoalStatus(goal="h", state=state),
    }
    check_failed(["g"], known)
    with pytest.raises(Refused, match=f"goal h is {state.value}, it has not failed") as error:
        check_failed(["g", "h"], known)
    assert instead in str(error.value)


def test_what_has_ended_does_not_become_more_urgent() -> None:
    failed = {"g": GoalStatus(goal="g", state=GoalState.FAILED)}
    check_open(["unread"], failed)
    with pytest.raises(Refused, match="goal g is failed: nothing of it is left to be done"):
        check_open(["unread", "g"], failed)


async def test_a_plan_that_comes_to_nothing_is_not_waited_for() -> None:
    making = WaitReason(kind=WaitKind.PLAN, plan="plan-1")
    being_planned = GoalStatus(goal="g", state=GoalState.WAITING, waits_for=(making,))
    view = FleetView(goal_status={"g": being_planned})
    nobody: Any = None  # nothing is asked of a planner that plans unasked

    async def refuse() -> None:
        view.goal_status["g"] = replace(being_planned, waits_for=(), reason="nobody can do it")
        view.changed.set()

    with pytest.raises(Refused, match="goal g: nobody can do it"):
        await asyncio.gather(have_planned(nobody, view, ["g"], "ana"), refuse())
