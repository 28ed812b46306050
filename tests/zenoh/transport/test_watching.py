"""A watch misses nothing, never goes back, and believes no empty store."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
import zenoh

from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.keyspace import FACT, GOAL_SPEC, SIM_CLOCK, SIM_SENSES
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.simulation import SimAddress, SimClock, SimRobotAddress
from keyexpr_schema.payloads.world import FactAddress
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.session import open_session
from keyexpr_schema.transport.store.storage import Write
from tests.support.polling import until
from tests.support.session_values import (
    AT,
    fact,
    goal,
    not_connected,
    senses,
    take,
    take_until_value,
)


async def test_a_watch_shows_what_is_stored_then_changes_then_deletions(session_config):
    async with open_session(session_config()) as session:
        await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
        async with session.watch(GOAL_SPEC, (FACT, {"subject": "cup_1"})) as watch:
            await watch.synced()
            [first] = await take(watch, 1)
            assert (first.key, first.address, first.value) == (
                GOAL_SPEC,
                GoalAddress("g1"),
                goal("g1"),
            )
            await session.confirm(FACT, AT, fact(1))
            await session.confirm(FACT, FactAddress("cup_2", "at"), fact(5))
            await session.delete(GOAL_SPEC, GoalAddress("g1"))
            changes = await take(watch, 2)
            assert [(c.key, c.value) for c in changes] == [(FACT, fact(1)), (GOAL_SPEC, None)]


async def test_a_watch_across_kill_9_misses_nothing_and_never_goes_back(router, session_config):
    async with (
        open_session(session_config(component="reader")) as reader,
        open_session(session_config(component="writer")) as writer,
        reader.watch(FACT) as watch,
    ):
        for number in range(0, 60, 20):
            for value in range(number, number + 10):
                await writer.confirm(FACT, AT, fact(value))
            router.restart()
            for value in range(number + 10, number + 20):
                await writer.confirm(FACT, AT, fact(value), 20)
            seen = await take_until_value(watch, number + 19)
            assert seen == sorted(seen)
            assert set(range(number, number + 10)) <= set(seen)


async def test_what_was_written_while_a_reader_was_cut_off_reaches_it(router, session_config):
    async with open_session(session_config()) as reader, reader.watch(FACT) as watch:
        await watch.synced()
        router.kill()
        await until(lambda: not_connected(reader))
        router.restart()
        async with open_session(session_config()) as writer:
            await writer.confirm(FACT, AT, fact(7))
        assert (await take_until_value(watch, 7))[-1] == 7


async def test_a_deletion_that_a_watch_missed_is_found_by_listing(router, session_config):
    """Deleted in the store while no router ran, so that no message ever told of it."""
    async with open_session(session_config(lease_s=1.0)) as reader, reader.watch(FACT) as watch:
        async with open_session(session_config()) as writer:
            await writer.confirm(FACT, AT, fact(1))
            await take_until_value(watch, 1)
        router.stop()
        await until(lambda: not_connected(reader))
        _delete_in_store(router.data_dir, "robotfleet/" + FACT.build(AT))
        router.restart()
        [change] = await take(watch, 1, 20)
        assert (change.address, change.value) == (AT, None)


def _delete_in_store(data_dir: Any, keyexpr: str) -> None:
    with SqliteStore(data_dir) as store:
        [known] = store.select(keyexpr)
        assert store.apply([Write(keyexpr, known.stamp + (1 << 128), True, "", b"")]) == 1


async def test_an_empty_router_is_not_taken_for_deletion(router, session_config):
    """A router without its store answers nothing; what is known stays known."""
    async with open_session(session_config()) as reader, reader.watch(FACT) as watch:
        async with open_session(session_config()) as writer:
            await writer.confirm(FACT, AT, fact(1))
        await take_until_value(watch, 1)
        router.kill()
        config = zenoh_config("router", listen=[router.endpoint])
        with await asyncio.to_thread(zenoh.open, config):
            await reader.wait_connected(10)
            with pytest.raises(TimeoutError):
                await take(watch, 1, 2.0)
        router.restart()
        async with open_session(session_config()) as writer:
            await writer.confirm(FACT, AT, fact(2))
        assert await take_until_value(watch, 2) == [2]


async def test_a_slow_reader_gets_only_the_latest_of_a_stream(session_config):
    async with (
        open_session(session_config()) as reader,
        open_session(session_config()) as writer,
        reader.watch(SIM_SENSES) as watch,
        reader.watch(SIM_CLOCK) as afterwards,
    ):
        for number in range(1, 51):
            writer.put(SIM_SENSES, SimRobotAddress("r1"), senses(float(number)))
        writer.put(SIM_CLOCK, SimAddress(), SimClock(time_s=50.0, wall_time_s=0.0, speed=None))
        await take(afterwards, 1)
        [newest] = await take(watch, 1)
        assert newest.value.time_s == 50.0
