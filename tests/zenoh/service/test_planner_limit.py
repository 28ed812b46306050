"""A planner process whose plug-in planner never comes to an end: nobody else notices."""

from __future__ import annotations

from pathlib import Path

import pytest

from keyexpr_schema.keyspace import ANSWER, GOAL_SPEC, GOAL_STATUS, PLAN_REQUEST
from keyexpr_schema.payloads.goals import Goal, GoalAddress, GoalState
from keyexpr_schema.payloads.requests import PlanRequest, RequestAddress
from tests.support.planner_process import ask_for_plan, finish, person, planner, value
from tests.support.plug_in_site import plug_in_site
from tests.support.router_process import RouterProcess

CODE = """
from fleet.planners import Planner

class Endless(Planner):
    name, strategies = "endless", ("big-dag",)
    def _solve(self, problem):
        while True:
            pass
"""


async def test_an_endless_dry_run_is_answered_and_a_plan_is_made_and_carried_out_meanwhile(
    router: RouterProcess, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = tmp_path / "site"
    site.mkdir()
    plug_in_site(site, CODE, {"robotfleet.planners": {"endless": "Endless"}})
    monkeypatch.setenv("PYTHONPATH", str(site))
    async with (
        planner(router.endpoint, tmp_path / "planner", "--planning-limit", "6"),
        person(router.endpoint) as session,
    ):
        other = Goal(goal="other", text="Bring cup 1 to the hallway")
        await session.confirm(GOAL_SPEC, GoalAddress("other"), other)
        await value(session, GOAL_STATUS, GoalAddress("other"), state=GoalState.WAITING)
        dry = PlanRequest(request="dry", goals=("other",), planner="endless", dry_run=True)
        await session.confirm(PLAN_REQUEST, RequestAddress("dry"), dry)
        await ask_for_plan(session)
        await finish(session, set())
        answer = await value(session, ANSWER, RequestAddress("dry"), accepted=False)
        assert answer.sentence == "planning took longer than 6 s"
