"""People who change their minds: goals that are taken back, and plans that are cancelled."""

from __future__ import annotations

import asyncio
import time
from contextlib import suppress

from benchmarks.chaos.plans import PLAN, Fault
from cli.client.planner_requests import ask_planner, have_planned, request_name, waits_unplanned
from cli.client.schedules import delete_goals
from cli.demo.mission_run import Demo
from cli.errors import CliError, Refused, Unknown
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalState
from keyexpr_schema.payloads.plans import ENDED_PLANS
from keyexpr_schema.payloads.requests import Control, ControlRequest

AGAIN_S = 0.3
LIMIT_S = 180.0


class ChangesOfMind:
    """What people do with the goals of a demo; what must come of it, the store's journal tells
    (`benchmarks.chaos.journal.Cancelled`)."""

    def __init__(self, demo: Demo) -> None:
        self._demo = demo

    async def change(self, fault: Fault) -> bool:
        """Take a goal back, or cancel the plan and have another one made; False: nothing was left
        of that. Returns when the planner has said so.

        Raises:
            TooLate: it did not within `LIMIT_S`.
        """
        if fault.of == (PLAN,):
            return await self._cancel()
        return await self._take_back()

    async def _take_back(self) -> bool:
        demo = self._demo
        status = demo.view.goal_status
        open_ = [g for g in demo.goals if g in status and status[g].state not in ENDED_GOALS]
        if not open_:
            return False
        goal = open_[0]
        until_s = time.monotonic() + LIMIT_S
        while True:
            try:
                await delete_goals(demo.session, (goal,))
            except Unknown:
                break  # an earlier try has done it
            except (CliError, SchemaError):
                if time.monotonic() > until_s:
                    raise
                await asyncio.sleep(AGAIN_S)
            else:
                break
        demo.goals = tuple(other for other in demo.goals if other != goal)
        await demo.view.until(lambda: goal not in status, LIMIT_S, f"{goal} to be dropped")
        print(f"  {goal} is taken back", flush=True)
        return True

    async def _cancel(self) -> bool:
        demo = self._demo
        plans = demo.view.plan_status
        ours = (p for p, s in plans.items() if not set(demo.goals).isdisjoint(s.goals))
        plan = next((p for p in ours if plans[p].state not in ENDED_PLANS), None)
        if plan is None:
            return False
        until_s = time.monotonic() + LIMIT_S
        while plans[plan].state not in ENDED_PLANS:
            asked = ControlRequest(request=request_name(), control=Control.CANCEL, plan=plan)
            try:
                await ask_planner(demo.session, asked, LIMIT_S)
            except Refused:
                pass  # an earlier request has come, or it has ended by itself
            except (CliError, SchemaError):
                if time.monotonic() > until_s:
                    raise
                await asyncio.sleep(AGAIN_S)
                continue
            what = f"{plan} to be cancelled"
            await demo.view.until(lambda: plans[plan].state in ENDED_PLANS, LIMIT_S, what)
        print(f"  {plan} is {plans[plan].state.value}", flush=True)
        await self._plan_anew(plan, until_s)
        return True

    async def _plan_anew(self, cancelled: str, until_s: float) -> None:
        """Have another plan made for what that one was for."""
        demo = self._demo
        status = demo.view.goal_status

        def without() -> list[str]:
            return [
                goal
                for goal in demo.goals
                if goal in status
                and status[goal].state not in ENDED_GOALS
                and (status[goal].state is GoalState.WAITING or status[goal].plan == cancelled)
            ]

        while without() and time.monotonic() < until_s:
            left = [goal for goal in without() if waits_unplanned(status[goal])]
            with suppress(CliError, SchemaError):
                await have_planned(demo.session, demo.view, left, "chaos")
            await asyncio.sleep(AGAIN_S)
