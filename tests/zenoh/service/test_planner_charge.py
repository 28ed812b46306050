"""Who is in charge of a realm, where the store was emptied and knows of nobody any more."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from functools import partial
from pathlib import Path

import zenoh
from msgspec.structs import replace

from keyexpr_schema.errors import Overtaken
from keyexpr_schema.keyspace import ORDER, PLANNER_STATUS, REPORT, UNDECODABLE
from keyexpr_schema.payloads.system import (
    LARGEST_EPOCH,
    LARGEST_OVERTAKEN,
    PlannerAddress,
    PlannerStatus,
)
from keyexpr_schema.payloads.tasks import Order, OrderAddress, Report, ReportAddress, ReportState
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.session import Session
from tests.support.planner_process import (
    ask_for_plan,
    finish,
    next_order,
    person,
    planner,
    value,
)
from tests.support.polling import DEADLINE_S, until
from tests.support.router_process import RouterProcess

STATUS = PlannerAddress()


def refusal(order: Order, fence: int) -> tuple[ReportAddress, Report]:
    report = Report(
        robot=order.robot, plan=order.plan, revision=order.revision, task=order.task,
        attempt=order.attempt, epoch=order.epoch, incarnation="i1", planner=order.planner,
        state=ReportState.REFUSED, reason="only the newer planner gives orders", fence=fence,
    )  # fmt: skip
    return ReportAddress.of(report), report


async def has_said_what_it_can(session: Session) -> bool:
    """From here on it writes its status no more by itself."""
    status = (await session.list(PLANNER_STATUS)).get(STATUS)
    return status is not None and bool(status.planners)


async def take_charge(session: Session, other: PlannerStatus) -> None:
    """Put the status of another planner, also if the one that is there puts its own just then."""

    async def stands() -> bool:
        try:
            await session.confirm(PLANNER_STATUS, STATUS, other)
        except Overtaken:
            return False
        return True

    await until(stands, "the other planner's status to stand")


async def test_a_fresh_planner_of_a_lower_epoch_does_not_stay_in_charge(
    router: RouterProcess, tmp_path: Path
) -> None:
    """As it takes it at a store that was emptied beneath a planner that goes on."""
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path):
            pass
        async with planner(router.endpoint, tmp_path):
            await until(partial(has_said_what_it_can, session), "what the planner can do")
            ours = await value(session, PLANNER_STATUS, STATUS, epoch=2)
            other = PlannerStatus(epoch=1, incarnation="fresh")
            await take_charge(session, other)
            await value(session, PLANNER_STATUS, STATUS, epoch=2, incarnation=ours.incarnation)
            await ask_for_plan(session)
            await finish(session, set())


async def test_a_planner_whose_epoch_another_has_taken_too_stops(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path) as first:
        await until(partial(has_said_what_it_can, session), "what the planner can do")
        other = PlannerStatus(epoch=1, incarnation="fresh")
        await take_charge(session, other)
        assert first.process is not None
        assert await asyncio.to_thread(first.process.wait, DEADLINE_S) == 1
        assert "planner fresh took charge" in first.end()


async def test_robots_that_have_had_orders_of_a_higher_epoch_take_those_of_a_fresh_planner(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path):
            await ask_for_plan(session)
            order = await next_order(session, set())
            assert order.epoch == 1
            await session.confirm(REPORT, *refusal(order, fence=7))
            again = await value(session, ORDER, OrderAddress.of(order), epoch=8)
            assert again == replace(order, epoch=8)
            await value(session, PLANNER_STATUS, STATUS, epoch=8)
            await finish(session, set())
        async with planner(router.endpoint, tmp_path):
            await value(session, PLANNER_STATUS, STATUS, epoch=9)


async def test_an_epoch_that_nobody_counted_up_to_counts_for_nothing(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session:
        nonsense = PlannerStatus(epoch=2**63 - 1, incarnation="nonsense")
        await session.confirm(PLANNER_STATUS, STATUS, nonsense)
        async with planner(router.endpoint, tmp_path):
            await value(session, PLANNER_STATUS, STATUS, epoch=1)
            await until(partial(has_said_what_it_can, session), "what the planner can do")
            with suppress(Overtaken):  # by the planner's own, if that was quicker than the answer
                await session.confirm(
                    PLANNER_STATUS, STATUS, replace(nonsense, epoch=LARGEST_EPOCH + 1)
                )
            await value(session, PLANNER_STATUS, STATUS, epoch=1)
            config = zenoh_config(
                "client", connect=(router.endpoint,), lease_s=10.0, namespace="test"
            )
            with zenoh.open(config) as foreign:
                block = zenoh.CongestionControl.BLOCK  # else a busy machine leaves it out
                foreign.put("planner/status", b"nonsense", congestion_control=block)
                await until(lambda: session.list(UNDECODABLE), "that the planner has heard of it")
            await until(partial(has_said_what_it_can, session), "that the planner says it again")
            await ask_for_plan(session)
            order = await next_order(session, set())
            await session.confirm(REPORT, *refusal(order, fence=LARGEST_OVERTAKEN + 1))
            await value(session, ORDER, OrderAddress.of(order), epoch=1, attempt=2)
            await finish(session, set())
