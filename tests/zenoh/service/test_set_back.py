"""Planner and store that are set back to an earlier state, one of them or both, go on and agree."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from keyexpr_schema.keyspace import (
    FACT,
    GOAL_SPEC,
    GOAL_STATUS,
    HOLD,
    OBJECT,
    ORDER,
    PLAN_STATUS,
    REPORT,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress, GoalState
from keyexpr_schema.payloads.holds import Hold, HoldAddress, HoldKind
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.tasks import Order, Report, ReportAddress, ReportState
from keyexpr_schema.payloads.world import FactAddress, ObjectAddress
from keyexpr_schema.transport.session import Session
from tests.support.household import SKILLS, cup, fact
from tests.support.planner_process import PlannerProcess, person, value, want
from tests.support.polling import until
from tests.support.process_ids import frozen
from tests.support.router_process import RouterProcess


class Hands:
    """What a worker keeps: attempts are made once, and told again when they are ordered again."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self.made: dict[tuple[str | None, str, str, int], Report] = {}

    async def carry_out(self, order: Order) -> None:
        name = (order.planner, order.plan, order.task, order.attempt)
        if name not in self.made:
            after = () if order.cancelled else SKILLS[order.skill].ground(order.args).after
            facts = tuple(
                fact(row.variable.subject, row.variable.relation, str(row.value), order.robot)
                for row in after
            )
            self.made[name] = Report(
                robot=order.robot, plan=order.plan, revision=order.revision, task=order.task,
                attempt=order.attempt, epoch=order.epoch, incarnation="i1", facts=facts,
                state=ReportState.CANCELLED if order.cancelled else ReportState.SUCCEEDED,
                planner=order.planner, told=True,
            )  # fmt: skip
        report = self.made[name]
        if await self._session.get(REPORT, ReportAddress.of(report)) == report:
            return
        for known in report.facts:
            await self._session.confirm(FACT, FactAddress.of(known.key), known)
        await self._session.confirm(REPORT, ReportAddress.of(report), report)

    async def one(self) -> Order:
        """Carry out the next task that is ordered."""

        async def ordered() -> Order | None:
            for order in (await self._session.list(ORDER, robot="hsr")).values():
                name = (order.planner, order.plan, order.task, order.attempt)
                if not order.cancelled and name not in self.made:
                    return order
            return None

        order = await until(ordered, "an order")
        assert isinstance(order, Order)
        await self.carry_out(order)
        return order

    async def until_reached(self) -> None:
        async def reached() -> bool:
            for order in (await self._session.list(ORDER, robot="hsr")).values():
                await self.carry_out(order)
            status = await self._session.get(GOAL_STATUS, GoalAddress("g"))
            return status is not None and status.state is GoalState.REACHED

        await until(reached, "the goal to be reached")


@pytest.mark.parametrize("back", ["planner", "store", "both"])
async def test_what_is_set_back_goes_on(back: str, router: RouterProcess, tmp_path: Path) -> None:
    data = tmp_path / "planner"
    planner = PlannerProcess(router.endpoint, data, "--auto-plan")
    try:
        await planner.start()
        async with person(router.endpoint) as session:
            hands = Hands(session)
            await want(session, "Bring cup 1 to the hallway")
            await hands.one()
            with frozen(planner.pid), router.frozen():  # nobody writes what is being copied
                for name, folder in (("planner", data), ("store", router.data_dir)):
                    shutil.copytree(folder, tmp_path / f"earlier-{name}")
            await hands.one()
            hold = Hold(hold="h1", kind=HoldKind.DRAIN, robots=("locobot",), by="ana")
            await session.confirm(HOLD, HoldAddress("h1"), hold)
            await session.confirm(OBJECT, ObjectAddress("cup_2"), cup(2))
            await session.confirm(
                GOAL_SPEC, GoalAddress("later"), Goal(goal="later", text="Search the attic.")
            )
            await value(session, GOAL_STATUS, GoalAddress("later"), state=GoalState.REJECTED)
            planner.kill()
            router.kill()
            for name, folder in (("planner", data), ("store", router.data_dir)):
                if back in (name, "both"):
                    shutil.rmtree(folder)
                    shutil.copytree(tmp_path / f"earlier-{name}", folder)
            router.start()
            await session.wait_connected()
            await planner.start()
            await hands.until_reached()

            async def agree() -> bool:
                plans = await session.list(PLAN_STATUS)
                return not await session.list(ORDER) and all(
                    status.state not in (PlanState.RUNNING, PlanState.READY)
                    for status in plans.values()
                )

            await until(agree, "planner and store to agree that all is done")
            assert bool(list(data.glob("set-back-*"))) == (back == "planner")
            if back != "both":  # somebody has it still
                assert await session.get(HOLD, HoldAddress("h1")) == hold
                assert await session.get(OBJECT, ObjectAddress("cup_2")) == cup(2)
                assert await session.get(GOAL_SPEC, GoalAddress("later")) is not None
    finally:
        planner.close()
