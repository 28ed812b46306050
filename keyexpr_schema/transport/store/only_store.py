"""Of the routers that are linked one has a store: two do not align after they were apart.

What one of them has deleted, the other would bring back. A store serves every realm of its routers,
so the token that says that it is there lies beside the realms.
"""

from __future__ import annotations

import asyncio
import time
import uuid
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import zenoh

from keyexpr_schema.errors import SecondStore
from keyexpr_schema.keyspace import STORE_ALIVE
from keyexpr_schema.payloads.system import StoreAliveAddress
from keyexpr_schema.transport.trace import Trace

BESIDE_REALMS = "_/"
"""No realm has that name."""
GONE_S = 4.0
"""How long the token of a store that is dead can stay [s]: a link's lease of 2 s, and as much
again."""


class OnlyStore:
    """The token of a store, and what is seen of others."""

    def __init__(self) -> None:
        self._own = f"{time.time_ns():020d}-{uuid.uuid4().hex[:8]}"
        self._others: set[str] = set()
        self._changed = asyncio.Event()
        self._loop = asyncio.get_running_loop()

    async def second(self) -> None:
        """Wait for ever for a store that was started before this one, and that stays there.

        Raises:
            SecondStore: there is one.
        """
        while True:
            self._changed.clear()
            if self._earlier():
                await asyncio.sleep(GONE_S)
                if earlier := self._earlier():
                    raise SecondStore.of(earlier)
            await self._changed.wait()

    def _earlier(self) -> list[str]:
        return sorted(each for each in self._others if each < self._own)

    @asynccontextmanager
    async def announced(self, session: zenoh.Session) -> AsyncIterator[OnlyStore]:
        """Show the token, and look for others, until the block ends."""
        key = f"{BESIDE_REALMS}{STORE_ALIVE.build(StoreAliveAddress(self._own))}"
        pattern = f"{BESIDE_REALMS}{STORE_ALIVE.pattern()}"
        trace = Trace("store")
        trace.note("token", STORE_ALIVE, key)
        trace.note("watch-tokens", STORE_ALIVE, pattern)
        liveliness = session.liveliness()
        token = liveliness.declare_token(key)
        try:
            watching = liveliness.declare_subscriber(pattern, self._heard, history=True)
            try:
                yield self
            finally:
                await asyncio.to_thread(watching.undeclare)
        finally:
            await asyncio.to_thread(token.undeclare)

    def _heard(self, sample: zenoh.Sample) -> None:
        other = str(sample.key_expr).rpartition("/")[2]
        there = sample.kind == zenoh.SampleKind.PUT
        if other != self._own:
            self._loop.call_soon_threadsafe(self._take_in, other, there)

    def _take_in(self, other: str, there: bool) -> None:
        (self._others.add if there else self._others.discard)(other)
        self._changed.set()
