"""What is confirmed is stored, and is read back by get and list."""

from __future__ import annotations

import asyncio

import pytest

from keyexpr_schema.errors import UndecodablePayload
from keyexpr_schema.keyspace import GOAL_SPEC, PLAN_REQUEST, STORE_JOURNAL
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.requests import PlanRequest, RequestAddress
from keyexpr_schema.payloads.system import StoreAddress, StoreQuery
from keyexpr_schema.transport.session import open_session
from tests.support.polling import DEADLINE_S, until
from tests.support.session_values import goal, not_connected


async def test_a_confirmed_value_is_read_back_listed_and_deleted(session_config):
    async with open_session(session_config()) as session:
        assert session.connected
        await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
        await session.confirm(GOAL_SPEC, GoalAddress("g2"), goal("g2"))
        assert await session.get(GOAL_SPEC, GoalAddress("g1")) == goal("g1")
        assert await session.list(GOAL_SPEC) == {GoalAddress(n): goal(n) for n in ("g1", "g2")}
        assert await session.list(GOAL_SPEC, goal="g2") == {GoalAddress("g2"): goal("g2")}
        await session.delete(GOAL_SPEC, GoalAddress("g1"))
        assert await session.get(GOAL_SPEC, GoalAddress("g1")) is None
        journal = await session.query(STORE_JOURNAL, StoreAddress(), StoreQuery())
        assert [(e.keyexpr, e.deleted) for e in journal.entries] == [
            (GOAL_SPEC.build(GoalAddress("g1")), False),
            (GOAL_SPEC.build(GoalAddress("g2")), False),
            (GOAL_SPEC.build(GoalAddress("g1")), True),
        ]
        assert journal.last == 3


async def test_realms_do_not_see_each_other(session_config):
    async with (
        open_session(session_config(realm="north")) as north,
        open_session(session_config(realm="south")) as south,
    ):
        await north.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
        assert await south.get(GOAL_SPEC, GoalAddress("g1")) is None
        assert await south.list(GOAL_SPEC) == {}
        async with south.watch(GOAL_SPEC) as watch:
            await watch.synced()
            await south.confirm(GOAL_SPEC, GoalAddress("g2"), goal("g2"))
            change = await asyncio.wait_for(anext(watch), DEADLINE_S)
            assert change.address == GoalAddress("g2")
        journal = await south.query(STORE_JOURNAL, StoreAddress(), StoreQuery())
        assert [e.keyexpr for e in journal.entries] == [GOAL_SPEC.build(GoalAddress("g2"))]


async def test_what_no_reader_could_read_is_not_put(session_config):
    async with open_session(session_config()) as session:
        asked = PlanRequest(request="r1", plan="a/b", goals=())
        with pytest.raises(
            UndecodablePayload, match=r"is not a PlanRequest: Expected a name \(1 to"
        ):
            await session.confirm(PLAN_REQUEST, RequestAddress("r1"), asked)
        assert await session.get(PLAN_REQUEST, RequestAddress("r1")) is None


async def test_every_confirmed_write_outlives_kill_9_in_mid_stream(router, session_config):
    async with open_session(session_config()) as session:
        confirmed: list[int] = []

        async def write_for_ever(first: int) -> None:
            for number in range(first, 1_000_000, 4):
                address = GoalAddress(f"g{number}")
                await session.confirm(GOAL_SPEC, address, goal(address.goal), 30.0)
                confirmed.append(number)

        for _ in range(4):
            before = len(confirmed)
            first = max(confirmed, default=0) // 4 * 4 + 4
            tasks = [asyncio.create_task(write_for_ever(first + i)) for i in range(4)]

            async def grown(least: int = before + 200) -> bool:
                return len(confirmed) >= least

            await until(grown)
            router.kill()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            promised = set(confirmed)
            router.restart()
            stored = await session.list(GOAL_SPEC, 10.0)
            missing = promised - {int(address.goal[1:]) for address in stored}
            assert not missing


async def test_a_confirm_that_spans_the_routers_death_arrives(router, session_config):
    async with open_session(session_config()) as session:
        router.kill()
        task = asyncio.create_task(
            session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"), DEADLINE_S)
        )
        await until(lambda: not_connected(session))
        assert not task.done()
        router.restart()
        await task
        assert await session.get(GOAL_SPEC, GoalAddress("g1")) == goal("g1")
