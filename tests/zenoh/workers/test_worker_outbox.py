"""What a worker's outbox does where the store has something of the same fact already."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest

from keyexpr_schema.errors import UndecodablePayload
from keyexpr_schema.full_disk import FullDisk
from keyexpr_schema.keyspace import FACT
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.link import Put
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from tests.support.polling import DEADLINE_S, until
from workers.orders.journal import Journal
from workers.orders.outbox import Outbox

AT = FactAddress("hsr", "at")


def at(place: str, time_s: float, source: str = "hsr") -> Fact:
    return Fact(subject="hsr", relation="at", value=place, source=source, time_s=time_s)


async def is_rubbish(session: Session) -> bool:
    try:
        await session.get(FACT, AT)
    except UndecodablePayload:
        return True
    return False


@pytest.mark.parametrize(
    ("stored", "expected"),
    [
        pytest.param(at("kitchen", 10.0), "hallway", id="an earlier run's, long on its way"),
        pytest.param(None, "hallway", id="what nobody can read"),
        pytest.param(at("attic", 30.0), "attic", id="a later word of its own"),
        pytest.param(at("attic", 10.0, "person"), "attic", id="somebody else's"),
    ],
)
async def test_a_fact_that_comes_late(
    session_config: Callable[..., SessionConfig], tmp_path: Path, stored: Fact | None, expected: str
) -> None:
    """Noted a minute ago by this run of the worker, and overtaken by what another session wrote."""
    async with (
        open_session(session_config()) as other,
        open_session(session_config()) as session,
    ):
        if stored is not None:
            await other.confirm(FACT, AT, stored)
        else:
            stamp = other.link.new_timestamp()
            await other.link.send(Put(FACT.build(AT), b"5", "application/json", stamp))
            await until(lambda: is_rubbish(other), "what nobody can read")
        with Journal(tmp_path / "hsr.journal") as journal:
            disk = FullDisk(tmp_path, "the worker", "it waits", lambda _: None)
            outbox = Outbox(session, journal, disk)
            sending = asyncio.create_task(outbox.run())
            await outbox.add(at("hallway", 20.0), age_s=60.0)
            async with asyncio.timeout(DEADLINE_S):
                await outbox.emptied()
            sending.cancel()
        there = await other.get(FACT, AT)
        assert there is not None and there.value == expected
