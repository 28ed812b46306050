"""What has passed on the link, and the store has not taken in or has lost, a watch takes back."""

from __future__ import annotations

import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace

import pytest

from keyexpr_schema.errors import Overtaken, WriteRefused
from keyexpr_schema.keyspace import FACT, GOAL_SPEC
from keyexpr_schema.limits import in_force, put_in_force
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.transport.link import Put
from keyexpr_schema.transport.samples import encoding_of
from keyexpr_schema.transport.session import Session, Watch, open_session
from tests.support.polling import until
from tests.support.session_values import AT, fact, goal, take, take_until_value

G1 = GoalAddress("g1")


@asynccontextmanager
async def watching_a_fact(session_config) -> AsyncIterator[tuple[Session, Watch]]:
    """Somebody who is not its writer, and a watch that has heard from the store that it is 1."""
    async with (
        open_session(session_config()) as one,
        open_session(session_config()) as other,
        one.watch(FACT) as watch,
    ):
        await watch.synced()
        await one.confirm(FACT, AT, fact(1))
        assert await take_until_value(watch, 1) == [1]
        before = watch.updates
        watch.relist()
        await until(lambda: watch.updates > before)
        yield other, watch


async def test_a_late_word_that_the_store_leaves_out_is_taken_back(session_config):
    async with watching_a_fact(session_config) as (other, watch):
        # Seen a minute ago, held back by a cut, and said now: everybody hears it.
        with pytest.raises(Overtaken):
            await other.confirm(FACT, AT, fact(2), age_s=60.0)
        assert await take_until_value(watch, 2) == [2]
        assert (await take_until_value(watch, 1))[-1] == 1
        assert watch.listings == 1
        # Whoever speaks next is heard as before.
        await other.confirm(FACT, AT, fact(3))
        assert (await take_until_value(watch, 3))[-1] == 3


async def test_a_late_deletion_that_the_store_leaves_out_is_taken_back(session_config):
    async with watching_a_fact(session_config) as (other, watch):
        # Said when this machine was started.
        stamp = other.link.new_timestamp()
        await other.link.send(Put(FACT.build(AT), None, encoding_of(FACT), stamp, said_s=0.0))
        assert await take_until_value(watch, None) == [None]
        assert await take_until_value(watch, 1) == [1]


async def test_what_the_store_refuses_is_taken_back(session_config):
    """The limits of this process are wider than those of the router's."""
    narrow = in_force()
    put_in_force(replace(narrow, value_kb=8 * narrow.value_kb))
    try:
        async with (
            open_session(session_config()) as session,
            session.watch(GOAL_SPEC, in_order=True) as watch,
        ):
            await watch.synced()
            await session.confirm(GOAL_SPEC, G1, goal("g1", "before"))
            for name in ("g1", "g2"):
                with pytest.raises(WriteRefused):
                    large = goal(name, "x" * 3 * narrow.value_kb * 1024)
                    await session.confirm(GOAL_SPEC, GoalAddress(name), large)
            changes = await take(watch, 5)
            texts = [(c.address.goal, c.value and c.value.text[:6]) for c in changes]
            assert texts[:3] == [("g1", "before"), ("g1", "xxxxxx"), ("g2", "xxxxxx")]
            assert sorted(texts[3:], key=str) == [("g1", "before"), ("g2", None)]
            # What it refused once it takes in once there is room.
            await session.confirm(GOAL_SPEC, GoalAddress("g2"), goal("g2", "short"))
            assert [c.value for c in await take(watch, 1)] == [goal("g2", "short")]
    finally:
        put_in_force(narrow)


async def test_what_a_store_that_was_set_back_has_lost_is_taken_back(
    router, session_config, tmp_path
):
    """Nobody is there who would write it again."""
    async with open_session(session_config()) as reader, reader.watch(GOAL_SPEC) as watch:
        await watch.synced()
        async with open_session(session_config()) as writer:
            await writer.confirm(GOAL_SPEC, G1, goal("g1", "before"))
            router.stop()
            shutil.copytree(router.data_dir, tmp_path / "earlier")
            router.start()
            await writer.confirm(GOAL_SPEC, G1, goal("g1", "after"))
        assert [c.value.text for c in await take(watch, 2)] == ["before", "after"]
        router.stop()
        shutil.rmtree(router.data_dir)
        shutil.copytree(tmp_path / "earlier", router.data_dir)
        router.start()
        assert [c.value.text for c in await take(watch, 1)] == ["before"]
