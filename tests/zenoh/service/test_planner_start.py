"""A planner that starts reads what is open, and hears what went away while there was none."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from keyexpr_schema.keyspace import (
    ANSWER,
    FACT,
    GOAL_SPEC,
    GOAL_STATUS,
    ORDER,
    PLAN_REQUEST,
    PLAN_SPEC,
    REPORT,
    SIM_CLOCK,
    UNDECODABLE,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress, GoalState
from keyexpr_schema.payloads.plans import PlanAddress
from keyexpr_schema.payloads.requests import PlanRequest, RequestAddress
from keyexpr_schema.payloads.simulation import SimAddress, SimClock
from keyexpr_schema.payloads.tasks import OrderAddress, ReportAddress
from keyexpr_schema.payloads.world import FactAddress
from keyexpr_schema.transport.link import Put
from keyexpr_schema.transport.session import Session
from tests.support.planner_process import (
    ask_for_plan,
    carry_out,
    finish,
    next_order,
    person,
    planner,
    value,
)
from tests.support.polling import until
from tests.support.router_process import RouterProcess


async def put_rubbish(session: Session, plan: str) -> str:
    """A report that nobody can read: whoever lists it says so."""
    keyexpr = REPORT.build(ReportAddress("hsr", plan, "t9", 1))
    await session.link.send(Put(keyexpr, b"{}", "", session.link.new_timestamp()))
    return keyexpr


async def rejected(session: Session) -> set[str]:
    return {v.keyexpr for v in (await session.list(UNDECODABLE, component="planner")).values()}


async def test_reports_of_plans_that_are_over_are_not_read_at_a_start(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path) as first:
            await ask_for_plan(session)
            order = await next_order(session, set())
            first.kill()
        of_the_past, of_now = [await put_rubbish(session, plan) for plan in ("past", "p")]
        await carry_out(session, order)
        async with planner(router.endpoint, tmp_path):
            await finish(session, {order.task})
            assert await rejected(session) == {of_now}
            assert of_the_past not in await rejected(session)


async def test_a_fact_deleted_while_no_planner_is_there_is_forgotten(
    router: RouterProcess, tmp_path: Path
) -> None:
    where = FactAddress("cup_1", "at")
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path):
            goal = Goal(goal="g", text="Bring cup 1 to the hallway")
            await session.confirm(GOAL_SPEC, GoalAddress("g"), goal)
            await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.WAITING)
        await session.delete(FACT, where)
        async with planner(router.endpoint, tmp_path):
            request = PlanRequest(request="r", plan="p")
            await session.confirm(PLAN_REQUEST, RequestAddress("r"), request)
            await value(session, ANSWER, RequestAddress("r"), accepted=True)
            plan = await value(session, PLAN_SPEC, PlanAddress("p"))
            assert plan.seeks == ("cup_1",), "where it was is not believed any more"


async def test_orders_that_nobody_follows_up_are_retracted_at_a_start(
    router: RouterProcess, tmp_path: Path
) -> None:
    """Somebody, or a store that lost its latest seconds, left an order that the planner ended."""
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path):
            await ask_for_plan(session)
            order = await next_order(session, set())
        stray = OrderAddress("hsr", "p", "t77")
        await session.confirm(ORDER, stray, replace(order, task="t77"))
        async with planner(router.endpoint, tmp_path):

            async def gone() -> bool:
                return stray not in await session.list(ORDER)

            await until(gone, "the stray order to go")
            assert OrderAddress.of(order) in await session.list(ORDER)


async def test_a_clock_that_is_deleted_disturbs_nobody(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with planner(router.endpoint, tmp_path), person(router.endpoint) as session:
        clock = SimClock(time_s=5.0, wall_time_s=0.0, speed=None)
        session.put(SIM_CLOCK, SimAddress(), clock)
        gone = Put(SIM_CLOCK.build(SimAddress()), None, "", session.link.new_timestamp())
        await session.link.send(gone)
        await ask_for_plan(session)
        await finish(session, set())
