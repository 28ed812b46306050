"""A store that closes while it is busy has taken in what had arrived."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
import zenoh

from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.store.server import CHANNEL, StoreServer
from keyexpr_schema.transport.store.storage import Write
from keyexpr_schema.transport.store.write_queues import BATCH
from tests.support.polling import DEADLINE_S, until

MANY = 2 * BATCH
"""Of which the most are still in Zenoh's channel when the first are written."""


class BusyStore(SqliteStore):
    """Writes when it may."""

    def __init__(self, data_dir: Path) -> None:
        super().__init__(data_dir)
        self.writing, self.may_write = threading.Event(), threading.Event()

    def apply(self, batch: Sequence[Write]) -> int:
        """As ever, when it may."""
        self.writing.set()
        self.may_write.wait(DEADLINE_S)
        return super().apply(batch)


@pytest.fixture
def session() -> Iterator[zenoh.Session]:
    with zenoh.open(zenoh_config("router")) as session:
        yield session


async def test_what_had_arrived_is_stored(session, tmp_path):
    assert MANY < CHANNEL
    with BusyStore(tmp_path) as store:
        others = set(threading.enumerate())
        server = StoreServer(session, store)
        (listening,) = (
            each for each in set(threading.enumerate()) - others if each.name == "store-listen"
        )
        put(session, "first")
        await until(store.writing.is_set, "the store to write")
        for number in range(MANY):
            put(session, f"more{number}")
        closing = threading.Thread(target=server.close)
        closing.start()
        await until(lambda: not listening.is_alive(), "the store to be closing")
        store.may_write.set()
        await until(lambda: not closing.is_alive(), "the store to be closed")
        assert len(store.select("robotfleet/world/facts/*/at")) == 1 + MANY


def put(session: zenoh.Session, subject: str) -> None:
    """Say something of it, to this session's own store: it has arrived when this returns."""
    session.put(f"robotfleet/world/facts/{subject}/at", b"{}")
