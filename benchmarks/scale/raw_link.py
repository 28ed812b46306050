"""Zenoh alone, beside what is measured: from a put to a subscriber of another session."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import zenoh
from zenoh import handlers

from keyexpr_schema.transport.connecting import zenoh_config

EVERY_S = 0.05
KEY = "beside/probe"
PAYLOAD = b"x" * 300
"""About as long as a report."""


@asynccontextmanager
async def raw_latencies(endpoint: str) -> AsyncIterator[list[float]]:
    """Seconds from put to callback through the router at `endpoint`, taken all along the block."""
    found: list[float] = []
    put_s = 0.0

    def arrived(sample: zenoh.Sample) -> None:
        found.append(time.perf_counter() - put_s)

    async def keep_on(publisher: zenoh.Session) -> None:
        nonlocal put_s
        while True:
            await asyncio.sleep(EVERY_S)
            put_s = time.perf_counter()
            publisher.put(KEY, PAYLOAD)

    configs = [zenoh_config("client", connect=[endpoint], namespace="raw") for _ in range(2)]
    with zenoh.open(configs[0]) as publisher, zenoh.open(configs[1]) as subscriber:
        subscriber.declare_subscriber(KEY, handlers.Callback(arrived, indirect=False))
        task = asyncio.create_task(keep_on(publisher))
        try:
            yield found
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
