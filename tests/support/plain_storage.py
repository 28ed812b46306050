"""A storage that keeps values and answers for them, and knows no question but `get`: as zenohd's.

A zenohd with its storage manager is not installed with the tests; this does what its volume in
memory does: the newest timestamp wins, a deletion leaves no reply, attachments are dropped.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import zenoh
from zenoh import handlers

from fleet.service.router_process import with_port
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.router import run_router


class PlainStorage:
    """Serves every key of one realm; `gets` counts the queries that it has seen."""

    def __init__(self, endpoint: str, realm: str = "robotfleet") -> None:
        self.gets = 0
        self._values: dict[str, zenoh.Sample] = {}
        self._session = zenoh.open(zenoh_config("client", connect=[endpoint]))
        self._session.declare_subscriber(
            f"{realm}/**", handlers.Callback(self._keep, indirect=False)
        )
        self._session.declare_queryable(
            f"{realm}/**", handlers.Callback(self._reply, indirect=False)
        )

    def _keep(self, sample: zenoh.Sample) -> None:
        assert sample.timestamp is not None
        if "*" in str(sample.key_expr):  # what is there, and matches, is changed
            found = [key for key in self._values if sample.key_expr.intersects(key)]
        else:
            found = [str(sample.key_expr)]
        for key in found:
            known = self._values.get(key)
            if known is None or known.timestamp < sample.timestamp:
                self._values[key] = sample

    def _reply(self, query: zenoh.Query) -> None:
        self.gets += 1
        with query:
            for key, sample in list(self._values.items()):
                kept = sample.kind == zenoh.SampleKind.PUT
                if kept and query.key_expr.intersects(key):
                    query.reply(
                        key, sample.payload, encoding=sample.encoding, timestamp=sample.timestamp
                    )

    def close(self) -> None:
        self._session.close()


@asynccontextmanager
async def plain_storage() -> AsyncIterator[tuple[str, PlainStorage]]:
    """The endpoint of a router that has no store of ours but such a storage, and the storage."""
    endpoint = with_port("tcp/127.0.0.1:0")
    async with run_router((endpoint,)):
        storage = PlainStorage(endpoint)
        try:
            yield endpoint, storage
        finally:
            storage.close()
