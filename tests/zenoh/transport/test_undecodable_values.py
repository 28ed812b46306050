"""Values that do not decode are reported once and stop nothing."""

from __future__ import annotations

import asyncio
from functools import partial

import pytest
import zenoh

from keyexpr_schema.errors import UndecodablePayload
from keyexpr_schema.keyspace import FACT, UNDECODABLE
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.session import Watch, open_session
from tests.support.polling import until
from tests.support.session_values import AT, fact, take

BLOCK = zenoh.CongestionControl.BLOCK
"""Else Zenoh leaves out what a busy machine has no time for."""
BAD = [
    (b"{", "application/json", "is not a Fact"),
    (b"\xff\xfe", "application/json;robotfleet/fact/1", "is not a Fact"),
    (b'{"subject": 3}', "application/json;robotfleet/fact/1", "Expected `str`, got `int`"),
    (b"{}", "application/json;robotfleet/goal_spec/1", "this key carries 'robotfleet/fact/1'"),
    (b"{}", "application/json;robotfleet/fact/2", "version 2 of fact"),
    (b"[" * 100_000, "application/json", "is not a Fact"),
]


async def test_bad_values_are_reported_once_and_stop_nothing(router, session_config):
    keyexpr = FACT.build(AT)
    config = zenoh_config("client", connect=[router.endpoint], namespace="robotfleet")
    async with (
        open_session(session_config(component="planner")) as session,
        session.watch(FACT) as watch,
        session.watch(UNDECODABLE) as rejects,
    ):
        await watch.synced()
        await rejects.synced()
        with await asyncio.to_thread(zenoh.open, config) as foreign:
            for count, (data, encoding, reason) in enumerate(BAD, start=1):
                foreign.put(keyexpr, data, encoding=encoding, congestion_control=BLOCK)
                [change] = await take(rejects, 1)
                assert change.value.keyexpr == keyexpr
                assert reason in change.value.reason
                assert change.value.count == count
                assert change.value.component == "planner"
            assert await session.list(FACT) == {}
            with pytest.raises(UndecodablePayload):
                await session.get(FACT, AT)
            foreign.put("world/facts/k\u00fcche/at", b"{}", congestion_control=BLOCK)
            [change] = await take(rejects, 1)
            assert "is not a fact key" in change.value.reason
        for _ in range(3):  # what two listings lack counts as deleted; this key never was one
            before = watch.updates
            watch.relist()
            await until(partial(listed_since, watch, before))
        await session.confirm(FACT, AT, fact(3))
        assert (await take(watch, 1))[0].value == fact(3)
        assert len(await session.list(UNDECODABLE)) == 2


async def listed_since(watch: Watch, before: int) -> bool:
    return watch.updates > before
