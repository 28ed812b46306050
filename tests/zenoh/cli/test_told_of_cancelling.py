"""What people hear of plans that others have cancelled, and of goals they have deleted."""

from __future__ import annotations

from pathlib import Path

from keyexpr_schema.keyspace import PLAN_STATUS
from keyexpr_schema.payloads.plans import PlanAddress, PlanState
from keyexpr_schema.payloads.tasks import ReportState
from tests.support.planner_process import next_order, person, planner, report, value
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess

WANTED = ("goal", "add", "Bring cup 1 to the hallway", "--plan", "--id")


async def test_who_has_cancelled_a_plan_or_deleted_its_goal_is_told_to_everybody_else(
    router: RouterProcess, tmp_path: Path
) -> None:
    robotctl = Robotctl(router.endpoint, tmp_path, "test")

    async def of(name: str, *arguments: str) -> str:
        said = await robotctl.soon("--as", name, *arguments)
        assert said.code == 0, said.err
        return said.out

    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path / "planner"):
        await of("ana", *WANTED, "first")
        order = await next_order(session, set())
        first = await of("ana", "plan", "cancel", "plan-1", "--why", "wet floor")
        second = await of("bob", "plan", "cancel", "plan-1")
        asked = await of("bob", "why", "first")
        await report(session, order, ReportState.CANCELLED)
        await value(session, PLAN_STATUS, PlanAddress("plan-1"), state=PlanState.CANCELLED)
        await of("ana", "goal", "delete", "first")

        await of("ana", *WANTED, "other")
        order = await next_order(session, set())
        await of("ana", "goal", "delete", "other")
        shown = await of("bob", "plan", "show", "plan-2")
        going = await of("bob", "why", "plan-2")
        await report(session, order, ReportState.CANCELLED)
        await value(session, PLAN_STATUS, PlanAddress("plan-2"), state=PlanState.CANCELLED)
        over = await of("bob", "why", "plan-2")
        history = (await of("bob", "history")).splitlines()
        about = await of("bob", "history", "--goal", "other", "--json")
        deeds = await of("bob", "audit")
        gone = await robotctl.soon("why", "other")
    assert first == "plan plan-1 is being cancelled\n"
    assert second == (
        "plan plan-1 is being cancelled already: ana has cancelled plan plan-1 (wet floor)\n"
    )
    assert "; plan-1 is being cancelled: ana has cancelled plan plan-1 (wet floor)" in " ".join(
        asked.split()
    )
    assert "cancel plan plan-1 (wet floor)" in deeds
    assert "deleted, its tasks are being withdrawn" in shown
    for said in (going, over):
        assert "goal other was deleted" in said and " by ana" in said
    assert any("plan-2" in row and "Bring cup 1" in row and "deleted" in row for row in history)
    assert '"plan": "plan-2"' in about
    assert gone.code == 1 and gone.err.endswith("; what is over is in `robotctl history`\n")
