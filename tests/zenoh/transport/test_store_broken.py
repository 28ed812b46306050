"""A store whose thread ends by a fault does not stand still in silence: its router ends."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Sequence

import pytest
import zenoh

from fleet.service.router_process import with_port
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import StoreBroken
from keyexpr_schema.keyspace import FACT, STORE_STAMPS
from keyexpr_schema.payloads.system import StoreAddress, StoreStampsQuery
from keyexpr_schema.payloads.world import FactAddress
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.session import SessionConfig, open_session
from keyexpr_schema.transport.store.server import CHANNEL, MOST_OPEN, QUERIES, StoreServer
from keyexpr_schema.transport.store.storage import Write
from keyexpr_schema.transport.store.write_queues import WriteQueues
from tests.support.polling import DEADLINE_S, until
from tests.support.session_values import fact

CUP_AT = FactAddress("cup", "at")


class Panic(BaseException):
    """As Zenoh's binding raises where its Rust code panics."""


class PanickingStore(SqliteStore):
    """Is no store for long."""

    def apply(self, batch: Sequence[Write]) -> int:
        """It does not come to that."""
        raise Panic("called `Option::unwrap()` on a `None` value")


class PanickingDisk(SqliteStore):
    """Has what is applied, and does not know whether that lasts."""

    def sync(self) -> None:
        """It does not come to that."""
        raise Panic("index out of bounds")


async def test_what_a_broken_store_could_not_sync_it_does_not_confirm(tmp_path):
    endpoint = with_port("tcp/127.0.0.1:0")
    with PanickingDisk(tmp_path) as store, pytest.raises(StoreBroken, match="bounds"):
        async with (
            run_router((endpoint,), store=store) as trouble,
            open_session(SessionConfig((endpoint,))) as session,
        ):
            session.put(FACT, CUP_AT, fact(0))
            asked = StoreStampsQuery(keys=(FACT.build(CUP_AT),))
            answer = await session.query(STORE_STAMPS, StoreAddress(), asked, DEADLINE_S)
            assert (answer.timestamps, answer.failing) == (("",), "index out of bounds")
            assert store.select(f"*/{FACT.build(CUP_AT)}")
            await asyncio.wait_for(trouble(), DEADLINE_S)


async def test_a_store_that_can_apply_nothing_any_more_closes(tmp_path, monkeypatch):
    def panics(*_: object, **__: object) -> None:
        raise Panic("already borrowed")

    monkeypatch.setattr(WriteQueues, "take", panics)
    faults: list[BaseException] = []
    with SqliteStore(tmp_path) as store, zenoh.open(zenoh_config("router")) as session:
        server = StoreServer(session, store, on_broken=faults.append)
        session.put("robotfleet/world/facts/cup/at", b"{}")
        await until(lambda: faults, "the store to break")
        # More wait for what cannot be applied than may be open.
        asked = [session.get("robotfleet/world/facts/cup/at") for _ in range(MOST_OPEN + QUERIES)]
        closing = threading.Thread(target=server.close)
        closing.start()
        await until(lambda: not closing.is_alive(), "the store to be closed")
        assert len(faults) <= 1 + len(asked)  # it waits for something else to come


@pytest.mark.parametrize("waiting", [0, 3 * CHANNEL], ids=["idle", "flooded"])
async def test_a_router_whose_store_has_broken_ends(tmp_path, waiting):
    endpoint = with_port("tcp/127.0.0.1:0")
    with PanickingStore(tmp_path) as store, pytest.raises(StoreBroken, match=r"unwrap.*again"):
        async with (
            run_router((endpoint,), store=store) as trouble,
            open_session(SessionConfig((endpoint,))) as session,
        ):
            for number in range(1 + waiting):
                session.put(FACT, FactAddress(f"cup{number}", "at"), fact(0))
            await asyncio.wait_for(trouble(), DEADLINE_S)
