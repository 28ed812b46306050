"""Watching liveliness tokens without mistaking the own lost link for everybody's death.

When the own link drops, Zenoh withdraws every token it had shown. So nothing is concluded while
the link is down; after it is back the others get time to come back, too, and a token counts as
lost only when a fresh query for tokens does not show it. Now and then Zenoh tells nobody of one
that is there, on a link that is new; so a watch looks again every now and then. And now and then
the answer to a query lacks one that is there: right after the watch's own subscription every third
(Zenoh 1.10, two busy cores), later one in thirty. So what nobody has withdrawn counts as lost only
when several queries in a row do not show it.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from math import inf
from typing import Any, Generic

from keyexpr_schema.errors import ForeignKey
from keyexpr_schema.key import A, Key
from keyexpr_schema.transport.change_stream import ChangeStream
from keyexpr_schema.transport.link import Link
from keyexpr_schema.transport.samples import Sample

REUNION_S = 2.0
"""After the own link came back: how long the others have. They retry every 0.5 s."""

LOOK_S = 5.0
"""Period of looking for what was missed while nothing seems wrong."""

LOOKS = 5
"""So many queries in a row do not show what counts as lost though nobody has withdrawn it."""


@dataclass(frozen=True)
class TokenChange(Generic[A]):
    """A token appeared (`alive`) or was lost."""

    address: A
    alive: bool


class TokenWatch(ChangeStream[TokenChange[A]], Generic[A]):
    """An async iterator of `TokenChange`; made by `Session.watch_tokens`."""

    def __init__(self, link: Link, key: Key[A, Any], pattern: str, debounce_s: float) -> None:
        super().__init__()
        self._link, self._key, self._pattern = link, key, pattern
        self._debounce_s = debounce_s
        self._alive: set[A] = set()
        self._doubted_until_s: dict[A, float] = {}
        self._gone_in_look: set[A] = set()
        """Withdrawn since the latest look began: what it brings of them is older than that."""
        self._withdrawn: set[A] = set()
        """Withdrawn on this link, and not seen since."""
        self._not_shown: Counter[A] = Counter()
        """How many looks in a row have not shown one."""
        self._generation = link.router.generation
        self._certain = asyncio.Event()
        self._certain.set()

    @property
    def alive(self) -> frozenset[A]:
        """The tokens that are there, whatever was handed to the iterator so far."""
        return frozenset(self._alive)

    async def certain(self) -> None:
        """Wait until nothing speaks against any token that is there."""
        await self._certain.wait()

    @asynccontextmanager
    async def running(self) -> AsyncIterator[TokenWatch[A]]:
        """Subscribe and look, until the block ends."""
        async with self._link.tokens_watched(self._pattern, self._on_sample):
            with self._link.router.listening(self._wake.set):
                async with self._in_background(self._watch_for_ever()):
                    yield self

    def _end(self, task: asyncio.Task[None]) -> None:
        super()._end(task)
        self._certain.set()

    def _on_sample(self, sample: Sample) -> None:
        try:
            address = self._key.parse(sample.keyexpr)
        except ForeignKey:
            return
        if not sample.deleted:
            back = address in self._gone_in_look
            self._gone_in_look.discard(address)
            self._see(address)
            if back:  # or it is one of those that were there at first, and comes late
                self._doubt(address, self._debounce_s)
            return
        self._gone_in_look.add(address)
        if address in self._alive:
            self._withdrawn.add(address)
            self._doubt(address, self._debounce_s)

    def _see(self, address: A) -> None:
        self._withdrawn.discard(address)
        del self._not_shown[address]
        self._no_doubt(address)
        if address not in self._alive:
            self._alive.add(address)
            self._add(TokenChange(address, alive=True))

    def _doubt(self, address: A, for_s: float) -> None:
        until_s = asyncio.get_running_loop().time() + for_s
        self._doubted_until_s[address] = max(until_s, self._doubted_until_s.get(address, 0.0))
        self._certain.clear()
        self._wake.set()

    def _no_doubt(self, address: A) -> None:
        self._doubted_until_s.pop(address, None)
        if not self._doubted_until_s:
            self._certain.set()

    async def _watch_for_ever(self) -> None:
        loop, router = asyncio.get_running_loop(), self._link.router
        looked_s = loop.time()
        while True:
            await router.wait_up()
            self._wake.clear()
            if router.generation != self._generation:
                self._withdrawn.clear()
                self._not_shown.clear()
                for address in self._alive:
                    self._doubt(address, max(REUNION_S, self._debounce_s))
                self._wake.clear()
                self._generation, looked_s = router.generation, -inf
            if not self._synced.is_set() or loop.time() >= looked_s + LOOK_S:
                if await self._look():
                    self._synced.set()
                looked_s = loop.time()
            due = [a for a, until_s in self._doubted_until_s.items() if until_s <= loop.time()]
            if due and await self._look():
                for address in due:
                    # What came during the look may have settled it, or begun it anew.
                    if self._doubted_until_s.get(address, inf) <= loop.time():
                        self._lose_or_look_again(address)
            pause_s = min(
                (until_s - loop.time() for until_s in self._doubted_until_s.values()),
                default=LOOK_S,
            )
            pause_s = min(pause_s, looked_s + LOOK_S - loop.time())
            await self._woken(max(0.02, pause_s) if self._synced.is_set() else 0.2)

    def _lose_or_look_again(self, address: A) -> None:
        if address not in self._withdrawn and self._not_shown[address] < LOOKS:
            self._doubt(address, self._debounce_s / LOOKS)
            return
        self._no_doubt(address)
        self._withdrawn.discard(address)
        del self._not_shown[address]
        self._alive.discard(address)
        self._add(TokenChange(address, alive=False))

    async def _look(self) -> bool:
        """See the tokens there are; False when those are not all: the link is new or down."""
        self._gone_in_look.clear()
        replies = await self._link.tokens(self._pattern, 3.0)
        router, shown = self._link.router, set[A]()
        for sample in replies.values:
            with suppress(ForeignKey):
                shown.add(self._key.parse(sample.keyexpr))
        for address in shown - self._gone_in_look:
            self._see(address)
        all_ = router.up and router.generation == self._generation and not replies.timed_out
        # A session shows a new subscriber tokens that itself has withdrawn before, now and then.
        for address in self._alive - shown if all_ else ():
            self._not_shown[address] += 1
            if address not in self._doubted_until_s:
                self._doubt(address, self._debounce_s / LOOKS)
        return all_
