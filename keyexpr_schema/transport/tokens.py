"""Watching liveliness tokens without mistaking the own lost link for everybody's death.

When the own link drops, Zenoh withdraws every token it had shown. So nothing is concluded while
the link is down; after it is back the others get time to come back, too, and a token counts as
lost only when a fresh query for tokens does not show it.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, Generic

from keyexpr_schema.errors import ForeignKey
from keyexpr_schema.key import A, Key
from keyexpr_schema.transport.link import Link
from keyexpr_schema.transport.samples import Sample

REUNION_S = 2.0
"""After the own link came back: how long the others have. They retry every 0.5 s."""


@dataclass(frozen=True)
class TokenChange(Generic[A]):
    """A token appeared (`alive`) or was lost."""

    address: A
    alive: bool


class TokenWatch(Generic[A]):
    """An async iterator of `TokenChange`; made by `Session.watch_tokens`."""

    def __init__(self, link: Link, key: Key[A, Any], pattern: str, debounce_s: float) -> None:
        self._link, self._key, self._pattern = link, key, pattern
        self._debounce_s = debounce_s
        self._alive: set[A] = set()
        self._doubted_until_s: dict[A, float] = {}
        self._ready: deque[TokenChange[A]] = deque()
        self._filled = asyncio.Event()
        self._synced = asyncio.Event()
        self._wake = asyncio.Event()
        self._failure: BaseException | None = None
        self._generation = link.router.generation

    def __aiter__(self) -> TokenWatch[A]:
        return self

    async def __anext__(self) -> TokenChange[A]:
        while not self._ready:
            if self._failure is not None:
                raise self._failure
            self._filled.clear()
            await self._filled.wait()
        return self._ready.popleft()

    @property
    def alive(self) -> frozenset[A]:
        """The tokens that are there, whatever was handed to the iterator so far."""
        return frozenset(self._alive)

    async def synced(self) -> None:
        """Wait until every token that was there at the start was handed to the iterator."""
        await self._synced.wait()

    @asynccontextmanager
    async def running(self) -> AsyncIterator[TokenWatch[A]]:
        """Subscribe and look, until the block ends."""
        async with self._link.tokens_watched(self._pattern, self._on_sample):
            with self._link.router.listening(self._wake.set):
                task = asyncio.create_task(self._watch_for_ever())
                task.add_done_callback(self._end)
                try:
                    yield self
                finally:
                    task.cancel()
                    await asyncio.gather(task, return_exceptions=True)

    def _on_sample(self, sample: Sample) -> None:
        try:
            address = self._key.parse(sample.keyexpr)
        except ForeignKey:
            return
        if not sample.deleted:
            self._see(address)
        elif address in self._alive:
            self._doubt(address, self._debounce_s)

    def _see(self, address: A) -> None:
        self._doubted_until_s.pop(address, None)
        if address not in self._alive:
            self._alive.add(address)
            self._report(address, True)

    def _doubt(self, address: A, for_s: float) -> None:
        until_s = asyncio.get_running_loop().time() + for_s
        self._doubted_until_s[address] = max(until_s, self._doubted_until_s.get(address, 0.0))
        self._wake.set()

    def _report(self, address: A, alive: bool) -> None:
        self._ready.append(TokenChange(address, alive))
        self._filled.set()

    def _end(self, task: asyncio.Task[None]) -> None:
        """A fault of the watching task must reach the reader, who would wait for ever."""
        if not task.cancelled():
            self._failure = task.exception()
            self._filled.set()
            self._synced.set()

    async def _watch_for_ever(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            await self._link.router.wait_up()
            self._wake.clear()
            if self._link.router.generation != self._generation or not self._synced.is_set():
                if self._link.router.generation != self._generation:
                    for address in self._alive:
                        self._doubt(address, max(REUNION_S, self._debounce_s))
                    self._wake.clear()
                self._generation = self._link.router.generation
                if await self._look() is not None:
                    self._synced.set()
            due = [a for a, until_s in self._doubted_until_s.items() if until_s <= loop.time()]
            if due:
                seen = await self._look()
                for address in due if seen is not None else ():
                    # A sample during the look may have settled it.
                    if self._doubted_until_s.pop(address, None) is not None:
                        self._alive.discard(address)
                        self._report(address, False)
            pause_s = min(
                (until_s - loop.time() for until_s in self._doubted_until_s.values()),
                default=None,
            )
            if not self._synced.is_set():
                pause_s = 0.2
            try:
                async with asyncio.timeout(None if pause_s is None else max(0.02, pause_s)):
                    await self._wake.wait()
            except TimeoutError:
                continue

    async def _look(self) -> set[A] | None:
        """See the tokens there are; None when that says nothing because the link is new or down."""
        replies = await self._link.tokens(self._pattern, 3.0)
        healthy = self._link.router.up and self._link.router.generation == self._generation
        seen = set()
        for sample in replies.values:
            try:
                address = self._key.parse(sample.keyexpr)
            except ForeignKey:
                continue
            seen.add(address)
            self._see(address)
        return seen if healthy and not replies.timed_out else None
