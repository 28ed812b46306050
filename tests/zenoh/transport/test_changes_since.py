"""What the store says has changed since a position, over a real link."""

from __future__ import annotations

import asyncio
from dataclasses import replace

from keyexpr_schema.keyspace import FACT, GOAL_SPEC
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.world import FactAddress
from keyexpr_schema.transport.link import Link, Put
from keyexpr_schema.transport.session import Session, open_session
from keyexpr_schema.transport.store.answers import Page
from keyexpr_schema.transport.store.client import StoreClient
from keyexpr_schema.transport.trace import Trace
from tests.support.polling import DEADLINE_S, until
from tests.support.session_values import fact, goal, not_connected

PATTERNS = (GOAL_SPEC.pattern(), FACT.pattern(subject="cup_1"))


def client(session: Session) -> StoreClient:
    return StoreClient(session.link, session.config.endpoints, Trace("test"), "test")


async def page(store: StoreClient, position: str, limit: int = 100) -> Page:
    found = await store.changes(PATTERNS, position, 5.0, limit)
    assert found is not None
    return found


def keys(found: Page) -> list[str]:
    return [("-" if s.deleted else "") + s.keyexpr for s in found.samples]


async def test_one_question_tells_what_changed_in_several_patterns(session_config):
    async with open_session(session_config()) as session:
        store = client(session)
        await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
        await session.confirm(FACT, FactAddress("cup_2", "at"), fact(1))
        first = await page(store, "")
        assert (keys(first), first.whole, first.more) == (["goals/g1/spec"], True, False)
        # What no reader could read, and is not even text, comes as it was put.
        raw = b"\xff\x00not a fact"
        await session.link.send(
            Put("world/facts/cup_1/at", raw, "x/y", session.link.new_timestamp())
        )
        session.put(GOAL_SPEC, GoalAddress("g2"), goal("g2"))
        await session.delete(GOAL_SPEC, GoalAddress("g1"))
        since = await page(store, first.position)
        assert (keys(since), since.whole) == (
            ["world/facts/cup_1/at", "goals/g2/spec", "-goals/g1/spec"],
            False,
        )
        assert (since.samples[0].data, since.samples[0].encoding) == (raw, "x/y")
        # It is the value and the exact stamp that a get brings.
        (got,) = await store.list("goals/g2/spec", 5.0)
        assert replace(since.samples[1], received=0) == got
        assert 0 < since.samples[0].received < since.samples[1].received
        assert (await page(store, since.position)).samples == ()


async def test_a_position_outlives_the_router_and_not_its_store(router, session_config):
    async with open_session(session_config()) as session:
        store = client(session)
        await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
        position = (await page(store, "")).position
        router.kill()
        await until(lambda: not_connected(session))
        assert await store.changes(PATTERNS, position, 0.2) is None
        router.start()
        await session.confirm(GOAL_SPEC, GoalAddress("g2"), goal("g2"))
        since = await page(store, position)
        assert (keys(since), since.whole) == (["goals/g2/spec"], False)
        router.kill()
        for file in router.data_dir.iterdir():
            file.unlink()
        router.start()
        await session.confirm(GOAL_SPEC, GoalAddress("g3"), goal("g3"))
        since = await page(store, since.position)
        assert (keys(since), since.whole) == (["goals/g3/spec"], True)


async def test_a_listing_of_many_comes_in_pages_of_a_bounded_size(session_config, monkeypatch):
    count = 2500
    sizes: list[int] = []
    query = Link.query

    async def counted(self, keyexpr, *args, **kwargs):
        replies = await query(self, keyexpr, *args, **kwargs)
        sizes.extend(len(sample.data) for sample in replies.values)
        return replies

    async with open_session(session_config()) as session:
        names = [f"g{number}" for number in range(count)]
        await asyncio.gather(
            *(
                session.confirm(GOAL_SPEC, GoalAddress(name), goal(name), DEADLINE_S)
                for name in names
            )
        )
        monkeypatch.setattr(Link, "query", counted)
        assert len(await session.list(GOAL_SPEC)) == count
    assert len(sizes) == 3
    assert max(sizes) < sum(sizes) / 2
