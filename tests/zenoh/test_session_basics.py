"""The typed session against a real router and store."""

from __future__ import annotations

import asyncio
import re
import time

import pytest

from keyexpr_schema.errors import UndecodablePayload, Unreachable
from keyexpr_schema.keyspace import GOAL_SPEC, PLAN_REQUEST, STORE_JOURNAL
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.payloads.requests import PlanRequest, RequestAddress
from keyexpr_schema.payloads.service import StoreAddress, StoreQuery
from keyexpr_schema.transport.session import SessionConfig, open_session


def goal(name: str, text: str = "bring the cup") -> Goal:
    return Goal(goal=name, text=text)


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
        journal = await session.ask(STORE_JOURNAL, StoreAddress(), StoreQuery())
        assert [(e.keyexpr, e.deleted) for e in journal.entries] == [
            (GOAL_SPEC.build(GoalAddress("g1")), False),
            (GOAL_SPEC.build(GoalAddress("g2")), False),
            (GOAL_SPEC.build(GoalAddress("g1")), True),
        ]
        assert journal.last == 3


async def test_without_a_router_opening_fails_with_one_sentence_and_in_time():
    started_s = time.monotonic()
    with pytest.raises(Unreachable, match=r"no router answers at tcp/127.0.0.1:9: start one with"):
        async with open_session(SessionConfig(endpoints=("tcp/127.0.0.1:9",))):
            pass
    assert time.monotonic() - started_s < 3.5


@pytest.mark.parametrize("endpoint", ["nonsense", "127.0.0.1:7447", "tcp/no-such-host.invalid:1"])
async def test_an_endpoint_that_is_none_is_one_sentence(endpoint):
    with pytest.raises(Unreachable, match=re.escape(endpoint)):
        async with open_session(SessionConfig(endpoints=(endpoint,), connect_timeout_s=1.0)):
            pass


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
            change = await asyncio.wait_for(anext(watch), 5)
            assert change.address == GoalAddress("g2")
        journal = await south.ask(STORE_JOURNAL, StoreAddress(), StoreQuery())
        assert [e.keyexpr for e in journal.entries] == [GOAL_SPEC.build(GoalAddress("g2"))]


async def test_what_no_reader_could_read_is_not_put(session_config):
    async with open_session(session_config()) as session:
        asked = PlanRequest(request="r1", plan="a/b", goals=())
        with pytest.raises(
            UndecodablePayload, match=r"is not a PlanRequest: Expected a name \(1 to"
        ):
            await session.confirm(PLAN_REQUEST, RequestAddress("r1"), asked)
        assert await session.get(PLAN_REQUEST, RequestAddress("r1")) is None
