"""Of several who write the same key at once one succeeds, and the others hear it."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack

import pytest

from fleet.service.router_process import with_port
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import NoReply, Unconfirmed
from keyexpr_schema.keyspace import GOAL_SPEC, PLANNER_STATUS, STORE_REPLACE
from keyexpr_schema.limits import Limits, put_in_force
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.system import (
    PlannerAddress,
    PlannerStatus,
    StoreAskerAddress,
    StoreReplaceQuery,
)
from keyexpr_schema.transport.link import Link, Put, Replies
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.samples import timestamp_of_stamp
from keyexpr_schema.transport.session import SessionConfig, open_session
from keyexpr_schema.transport.stamps import stamp_of_text
from keyexpr_schema.transport.store.client import SETTLE_S
from tests.support.polling import until
from tests.support.session_values import goal, not_connected, take

G1 = GoalAddress("g1")
CLAIM = PlannerAddress()


async def test_of_many_who_create_the_same_key_exactly_one_succeeds(session_config):
    async with AsyncExitStack() as stack:
        sessions = [
            await stack.enter_async_context(open_session(session_config())) for _ in range(12)
        ]
        for round_number in range(20):
            address = GoalAddress(f"g{round_number}")
            done = await asyncio.gather(
                *(
                    s.create(GOAL_SPEC, address, goal(address.goal, f"wish {number}"))
                    for number, s in enumerate(sessions)
                )
            )
            assert done.count(True) == 1
            stored = await sessions[0].get(GOAL_SPEC, address)
            assert stored == goal(address.goal, f"wish {done.index(True)}")


async def test_no_update_of_many_is_lost(session_config):
    """Each of ten sessions raises the epoch ten times; all rises are there, none twice."""

    def higher(name: str):
        return lambda seen: PlannerStatus(epoch=1 + (seen.epoch if seen else 0), incarnation=name)

    async with AsyncExitStack() as stack:
        sessions = [
            await stack.enter_async_context(open_session(session_config(component="planner")))
            for _ in range(10)
        ]

        async def rise(number: int) -> list[int]:
            session = sessions[number]
            return [
                (await session.update(PLANNER_STATUS, CLAIM, higher(f"p{number}"), 60.0)).epoch
                for _ in range(10)
            ]

        epochs = await asyncio.gather(*map(rise, range(10)))
        assert sorted(epoch for each in epochs for epoch in each) == list(range(1, 101))


async def test_subscribers_see_it_as_a_put_and_a_deleted_name_is_free_again(session_config):
    async with open_session(session_config()) as one, open_session(session_config()) as other:
        async with other.watch(GOAL_SPEC) as watch:
            await watch.synced()
            # A change of another session may arrive after a later one of our own, and then be
            # left out as an older one: so each is awaited.
            seen = []
            assert await one.create(GOAL_SPEC, G1, goal("g1", "first"))
            seen += await take(watch, 1)
            assert not await one.create(GOAL_SPEC, G1, goal("g1", "first"))
            await other.delete(GOAL_SPEC, G1)
            seen += await take(watch, 1)
            assert await one.create(GOAL_SPEC, G1, goal("g1", "second"))
            seen += await take(watch, 1)
            # It is a value like any other.
            await other.confirm(GOAL_SPEC, G1, goal("g1", "third"))
            seen += await take(watch, 1)
        assert [c.value and c.value.text for c in seen] == ["first", None, "second", "third"]


async def test_what_does_not_decode_is_replaced_all_the_same(session_config):
    async with open_session(session_config(component="planner")) as session:
        stamp = session.link.new_timestamp()
        await session.link.send(Put(PLANNER_STATUS.build(CLAIM), b"nonsense", "", stamp))
        first = PlannerStatus(epoch=3, incarnation="a")
        seen: list[PlannerStatus | None] = []

        def change(status: PlannerStatus | None) -> PlannerStatus:
            seen.append(status)
            return first

        assert await session.update(PLANNER_STATUS, CLAIM, change) == first
        assert await session.get(PLANNER_STATUS, CLAIM) == first
        assert seen == [None]


async def test_an_answer_that_was_lost_is_asked_for_again(router, session_config, monkeypatch):
    """The store has written it, and then the router dies before it can say so."""
    async with open_session(session_config()) as session:

        async def restarted():
            router.restart()
            await until(lambda: connected(session))

        lose_an_answer(monkeypatch, session, restarted)
        assert await session.create(GOAL_SPEC, G1, goal("g1"), 30.0)
        assert await session.get(GOAL_SPEC, G1) == goal("g1")
        assert not await session.create(GOAL_SPEC, G1, goal("g1"))


async def test_who_created_hears_so_whatever_others_have_written_since(session_config, monkeypatch):
    async with open_session(session_config()) as session, open_session(session_config()) as other:

        async def changed():
            await other.confirm(GOAL_SPEC, G1, goal("g1", "of another"))

        lose_an_answer(monkeypatch, session, changed)
        assert await session.create(GOAL_SPEC, G1, goal("g1"), 30.0)
        assert await session.get(GOAL_SPEC, G1) == goal("g1", "of another")

        async def deleted():
            await other.delete(GOAL_SPEC, G1)

        calls = []

        def change(seen):
            calls.append(seen)
            return goal("g1", "changed")

        lose_an_answer(monkeypatch, session, deleted)
        await session.update(GOAL_SPEC, G1, change, 30.0)
        assert await session.get(GOAL_SPEC, G1) is None  # it was not made twice
        assert calls == [goal("g1", "of another")]


async def test_a_store_that_was_away_behind_another_router_compares_itself(
    session_config, monkeypatch
):
    """Nobody answers, and the link is up: that need be no zenohd, where who asks compares."""
    async with open_session(session_config()) as session:
        await until(lambda: session.link.router.age_s >= SETTLE_S)
        query, asked = Link.query, []

        async def away(self, keyexpr, *args, **kwargs):
            if keyexpr == STORE_REPLACE.build(StoreAskerAddress(session.config.component)):
                asked.append(keyexpr)
                if len(asked) <= 2:
                    return Replies()
            return await query(self, keyexpr, *args, **kwargs)

        monkeypatch.setattr(Link, "query", away)
        assert await session.create(GOAL_SPEC, G1, goal("g1"), 30.0)
        assert len(asked) == 3


def lose_an_answer(monkeypatch, session, then):
    """The next answer of the store's is lost, and `then` happens before it is asked again."""
    query = Link.query

    async def lost_once(self, keyexpr, *args, **kwargs):
        replies = await query(self, keyexpr, *args, **kwargs)
        if keyexpr != STORE_REPLACE.build(StoreAskerAddress(session.config.component)):
            return replies
        monkeypatch.setattr(Link, "query", query)
        await then()
        return Replies(timed_out=True)

    monkeypatch.setattr(Link, "query", lost_once)


async def connected(session) -> bool:
    return session.connected


async def test_a_clock_that_is_a_little_ahead_is_waited_for_and_one_far_ahead_is_told(
    tmp_path,
):
    endpoint = with_port("tcp/127.0.0.1:0")
    put_in_force(Limits(ahead_s=2 * LONG_S))
    try:
        with SqliteStore(tmp_path) as store:
            async with (
                run_router((endpoint,), store=store),
                open_session(SessionConfig((endpoint,))) as session,
            ):
                await _create_what_clocks_ahead_have_deleted(session)
    finally:
        put_in_force(Limits())


LONG_S = 3600.0
"""Ahead of the clock here; nobody waits so long."""


async def _create_what_clocks_ahead_have_deleted(session):
    for ahead_s, name in ((0.3, "g1"), (LONG_S, "g2"), (3 * LONG_S, "g3")):
        stamp = stamp_of_text(str(session.link.new_timestamp())) + (int(ahead_s * 2**32) << 128)
        keyexpr = GOAL_SPEC.build(GoalAddress(name))
        await session.link.send(Put(keyexpr, None, "", timestamp_of_stamp(stamp)))
    assert await session.create(GOAL_SPEC, G1, goal("g1"))
    with pytest.raises(Unconfirmed, match=r"a clock that is \S+ s ahead of the router's"):
        await session.create(GOAL_SPEC, GoalAddress("g2"), goal("g2"))
    assert await session.create(GOAL_SPEC, GoalAddress("g3"), goal("g3"))  # not believed
    assert "s ahead of the clock here" in ((await session.store_troubles()).refusing or "")


async def test_what_is_not_stored_cannot_be_replaced(session_config):
    async with open_session(session_config()) as session:
        for keyexpr in ("sim/clock", "goals/*/spec", "nonsense"):
            asked = StoreReplaceQuery(keyexpr=keyexpr, value="{}")
            with pytest.raises(NoReply, match="is not a key that the store keeps"):
                await session.query(STORE_REPLACE, StoreAskerAddress("client"), asked)


async def test_without_its_router_it_says_so(router, session_config):
    async with open_session(session_config()) as session:
        router.kill()
        await until(lambda: not_connected(session))
        with pytest.raises(Unconfirmed, match="no router answers"):
            await session.create(GOAL_SPEC, G1, goal("g1"), 0.3)
