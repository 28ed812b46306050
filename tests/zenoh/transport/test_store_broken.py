"""A store whose thread ends by a fault does not stand still in silence: its router ends."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest

from fleet.service.router_process import with_port
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import StoreBroken
from keyexpr_schema.keyspace import FACT
from keyexpr_schema.payloads.world import FactAddress
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.session import SessionConfig, open_session
from keyexpr_schema.transport.store.server import CHANNEL
from keyexpr_schema.transport.store.storage import Write
from tests.support.polling import DEADLINE_S
from tests.support.session_values import fact


class Panic(BaseException):
    """As Zenoh's binding raises where its Rust code panics."""


class PanickingStore(SqliteStore):
    """Is no store for long."""

    def apply(self, batch: Sequence[Write]) -> int:
        """It does not come to that."""
        raise Panic("called `Option::unwrap()` on a `None` value")


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
