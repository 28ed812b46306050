"""Reading from whatever keeps the values, and confirming what was written to it.

What holds on any Zenoh storage, the embedded one or zenohd's:

* A put while the router is away is lost without an error, so what must last is read back.
* Empty is not absent: an empty listing is believed only when the store proved to be there after
  the link came up (it answers for its journal), or, with a zenohd storage that has no journal,
  when the link has been up for `SETTLE_S`.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass
from typing import Any

from keyexpr_schema.errors import Unconfirmed, Unreachable
from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import STORE_JOURNAL
from keyexpr_schema.payloads.system import StoreAddress, StoreQuery
from keyexpr_schema.transport.link import Link
from keyexpr_schema.transport.samples import Sample, encoding_of, stamp_of_text
from keyexpr_schema.transport.trace import Trace

SETTLE_S = 0.5
_RESEND_S = 0.25


@dataclass(frozen=True)
class Mark:
    """A point in the life of a store: which one, and the number of its latest change by then."""

    store: str
    number: int


@dataclass(frozen=True)
class Changes:
    """The newest value, or the deletion, of every key that changed, up to `mark`."""

    samples: tuple[Sample, ...]
    mark: Mark


class StoreClient:
    """The store behind a link; `endpoints` are named in errors."""

    def __init__(self, link: Link, endpoints: tuple[str, ...], trace: Trace) -> None:
        self._link, self._endpoints, self._trace = link, endpoints, trace

    async def write(
        self, key: Key[Any, Any], keyexpr: str, data: bytes | None, timeout_s: float
    ) -> None:
        """Put (`data` None: delete), and return when the store has it, or something newer.

        Raises:
            Unconfirmed: it was not read back within `timeout_s`; it may still arrive.
        """
        router = self._link.router
        timestamp = self._link.new_timestamp()
        ours = stamp_of_text(str(timestamp))
        try:
            async with asyncio.timeout(timeout_s):
                while True:
                    await router.wait_up()
                    generation = router.generation
                    await self._link.send(keyexpr, data, encoding_of(key), timestamp)
                    if await self._read_back(keyexpr, ours, data is None, generation):
                        return
        except TimeoutError:
            why = (
                "a router is there, but no store answers for this key"
                if router.up
                else f"no router answers at {', '.join(self._endpoints)}"
            )
            raise Unconfirmed(
                f"{'deleting ' if data is None else ''}{keyexpr} was not confirmed by the store "
                f"within {timeout_s:g} s: {why}"
            ) from None

    async def _read_back(self, keyexpr: str, ours: int, gone: bool, generation: int) -> bool:
        loop = asyncio.get_running_loop()
        router = self._link.router
        resend_at_s = loop.time() + _RESEND_S
        pause_s = 0.0005
        while router.up and router.generation == generation:
            replies = await self._link.query(keyexpr, 2.0)
            stored = max((s.stamp for s in replies.values if not s.deleted), default=None)
            if stored is not None and stored >= ours:
                return True
            if gone and stored is None and not replies.timed_out and not replies.errors:
                samples = await self._settled(keyexpr, 2.0)
                newest = max((sample.stamp for sample in samples), default=ours)
                # Absent proves the deletion only where the query followed it down one link.
                if newest >= ours and router.generation == generation:
                    return True
            if loop.time() >= resend_at_s:
                return False
            await asyncio.sleep(pause_s)
            pause_s = min(0.05, pause_s * 2)
        return False

    async def list(self, pattern: str, timeout_s: float) -> tuple[Sample, ...]:
        """The newest stored value of every key that `pattern` matches, undecoded.

        Raises:
            Unreachable: no router and store could be asked within `timeout_s`.
        """
        try:
            async with asyncio.timeout(timeout_s):
                return await self._settled(pattern, timeout_s)
        except TimeoutError:
            if not self._link.router.up:
                raise Unreachable.no_router(self._endpoints, timeout_s) from None
            raise Unreachable(
                f"the store did not answer for {pattern!r} within {timeout_s:g} s"
            ) from None

    async def _settled(self, pattern: str, timeout_s: float) -> tuple[Sample, ...]:
        router = self._link.router
        proven = -1
        while True:
            await router.wait_up()
            generation = router.generation
            replies = await self._link.query(pattern, timeout_s)
            newest: dict[str, Sample] = {}
            for sample in replies.values:
                if sample.keyexpr not in newest or newest[sample.keyexpr].stamp < sample.stamp:
                    newest[sample.keyexpr] = sample
            complete = not replies.timed_out and not replies.errors
            values = tuple(sample for sample in newest.values() if not sample.deleted)
            if complete and (values or proven == generation == router.generation):
                return values
            if complete and (router.age_s >= SETTLE_S or await self.answers(timeout_s)):
                proven = generation
                continue
            await asyncio.sleep(0.05)

    async def pages(self, pattern: str, timeout_s: float) -> AsyncIterator[tuple[Sample, ...]]:
        """What `list` returns, piece by piece; `timeout_s` holds for each.

        Raises:
            Unreachable: no router and store could be asked within `timeout_s`.
        """
        yield await self.list(pattern, timeout_s)

    async def mark(self, timeout_s: float) -> Mark | None:
        """Where the store's changes are now; None: the storage does not number them."""
        return None

    async def changes(
        self, patterns: Sequence[str], since: Mark, timeout_s: float
    ) -> Changes | None:
        """What changed after `since` of the keys that match one of the patterns.

        None: the store cannot say, and everything has to be listed.

        Raises:
            Unreachable: no router and store could be asked within `timeout_s`.
        """
        return None

    async def answers(self, timeout_s: float) -> bool:
        """Whether a store that keeps a journal answers now; a zenohd storage never does."""
        keyexpr = STORE_JOURNAL.build(StoreAddress())
        self._trace.note("query", STORE_JOURNAL, keyexpr)
        replies = await self._link.query(
            keyexpr,
            timeout_s,
            STORE_JOURNAL.encode(StoreQuery(limit=0)),
            encoding_of(STORE_JOURNAL),
            first=True,
        )
        return bool(replies.values)
