"""Level-triggered watching of keys: what is stored, then what changes, then what was missed.

The rule for deletions. A deletion that passes on the link is believed. One that was missed shows
only as a key that a listing lacks, and empty is not absent: after a reconnection Zenoh answers
with less than there is, and a store that is away answers with nothing. So a key is taken for
deleted when two listings in a row lack it, both taken in one generation of the link, and in the
second one the store proved to be there (it listed something else, or it answered for its journal).
"""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import AsyncIterator, Coroutine
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass
from typing import Any, Generic, Self, TypeVar

from keyexpr_schema.errors import ForeignKey, UndecodablePayload, Unreachable
from keyexpr_schema.key import A, Delivery, Key, P
from keyexpr_schema.transport.link import Link
from keyexpr_schema.transport.samples import Sample, decode_value, text_of_stamp
from keyexpr_schema.transport.store.client import StoreClient
from keyexpr_schema.transport.undecodable import UndecodableReports

T = TypeVar("T")
RELIST_S = 5.0
"""Period of re-listing while nothing seems wrong."""
_RETRY_S = 0.2


@dataclass(frozen=True)
class Change(Generic[A, P]):
    """A new value of one key; `value` None: deleted. `timestamp` is Zenoh's, as text."""

    key: Key[A, P]
    address: A
    value: P | None
    timestamp: str


class _Selection:
    """One watched pattern and what is known of the keys in it."""

    def __init__(self, watch: Watch, key: Key[Any, Any], pattern: str) -> None:
        self.watch, self.key, self.pattern = watch, key, pattern
        self.stamps: dict[str, int] = {}
        self.live: set[str] = set()
        self.missing: set[str] = set()
        self.missing_generation = 0

    def offer(self, sample: Sample) -> None:
        """Pass on what is newer than what is known of its key."""
        stamp = sample.stamp
        known = self.stamps.get(sample.keyexpr)
        if "*" in sample.keyexpr:
            # A wildcard put or delete: it concerns the keys that exist, which a listing shows.
            self.watch.relist()
            return
        try:
            address = self.key.parse(sample.keyexpr)
        except ForeignKey as error:
            # The pattern matches it and the store may keep it, but nobody can have an id in it.
            self.watch.undecodable.report(sample.keyexpr, sample.data, str(error))
            return
        if known is not None and stamp <= known and stamp:
            return
        if stamp:
            self.stamps[sample.keyexpr] = stamp
        self.missing.discard(sample.keyexpr)
        (self.live.discard if sample.deleted else self.live.add)(sample.keyexpr)
        try:
            value = None if sample.deleted else decode_value(self.key, sample)
        except UndecodablePayload as error:
            self.watch.undecodable.report(sample.keyexpr, sample.data, str(error))
            return
        self.watch.deliver(sample.keyexpr, Change(self.key, address, value, text_of_stamp(stamp)))

    async def relist(self) -> bool:
        """List once; whether it has to be done again soon (something known was not in it)."""
        router = self.watch.link.router
        generation = router.generation
        known = set(self.live)
        samples = await self.watch.store.list(self.pattern, 3.0)
        for sample in samples:
            self.offer(sample)
        missing = (known & self.live) - {sample.keyexpr for sample in samples}
        if router.generation != generation or not router.up:
            return True
        again = self.missing & missing if self.missing_generation == generation else set()
        self.missing, self.missing_generation = missing - again, generation
        if again and not (samples or await self.watch.store.answers(1.0)):
            self.missing = missing
            return False  # cannot be told apart from a store that is away: keep what is known
        for keyexpr in sorted(again & self.live):
            self.live.discard(keyexpr)
            address = self.key.parse(keyexpr)
            stamp = text_of_stamp(self.stamps.get(keyexpr, 0))
            self.watch.deliver(keyexpr, Change(self.key, address, None, stamp))
        return bool(self.missing)


class ChangeStream(Generic[T]):
    """An async iterator that is filled in the background."""

    def __init__(self) -> None:
        self._ready: OrderedDict[object, T] = OrderedDict()
        self._filled = asyncio.Event()
        self._synced = asyncio.Event()
        self._wake = asyncio.Event()
        self._failure: BaseException | None = None

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> T:
        while not self._ready:
            if self._failure is not None:
                raise self._failure
            self._filled.clear()
            await self._filled.wait()
        return self._ready.popitem(last=False)[1]

    async def synced(self) -> None:
        """Wait until everything that was there at the start was handed to the iterator once."""
        await self._synced.wait()

    def _add(self, change: T, instead_of: str | None = None) -> None:
        """Queue `change`, in place of one that waits under the same name."""
        slot = object() if instead_of is None else instead_of
        self._ready.pop(slot, None)
        self._ready[slot] = change
        self._filled.set()

    @asynccontextmanager
    async def _in_background(self, work: Coroutine[Any, Any, None]) -> AsyncIterator[Self]:
        task = asyncio.create_task(work)
        task.add_done_callback(self._end)
        try:
            yield self
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    def _end(self, task: asyncio.Task[None]) -> None:
        """A fault in the background must reach the reader, who would wait for ever."""
        if not task.cancelled():
            self._failure = task.exception()
            self._filled.set()
            self._synced.set()

    async def _woken(self, timeout_s: float | None) -> None:
        """Return when woken up, or after `timeout_s`."""
        with suppress(TimeoutError):
            async with asyncio.timeout(timeout_s):
                await self._wake.wait()


class Watch(ChangeStream[Change[Any, Any]]):
    """An async iterator of `Change`; made by `Session.watch`.

    Values of `STREAM` and `LATEST` keys that were not taken yet are replaced by newer ones of the
    same key; of other keys every change that was seen is delivered.
    """

    def __init__(
        self,
        link: Link,
        store: StoreClient,
        undecodable: UndecodableReports,
        selections: list[tuple[Key[Any, Any], str]],
    ) -> None:
        super().__init__()
        self.link, self.store, self.undecodable = link, store, undecodable
        self._selections = [_Selection(self, key, pattern) for key, pattern in selections]
        self.listings = 0
        """How often all that is stored was listed."""

    def relist(self) -> None:
        """List soon."""
        self._wake.set()

    def deliver(self, keyexpr: str, change: Change[Any, Any]) -> None:
        """Queue `change` for the iterator."""
        latest = change.key.delivery in (Delivery.STREAM, Delivery.LATEST)
        self._add(change, keyexpr if latest else None)

    @asynccontextmanager
    async def running(self) -> AsyncIterator[Watch]:
        """Subscribe, then list and keep listing, until the block ends."""
        async with AsyncExitStack() as stack:
            for selection in self._selections:
                await stack.enter_async_context(
                    self.link.subscribed(selection.pattern, selection.offer)
                )
            stack.enter_context(self.link.router.listening(self.relist))
            yield await stack.enter_async_context(self._in_background(self._list_for_ever()))

    async def _list_for_ever(self) -> None:
        stored = [selection for selection in self._selections if selection.key.stored]
        if not stored:
            self._synced.set()
            return
        while True:
            self._wake.clear()
            again = False
            try:
                for selection in stored:
                    again |= await selection.relist()
                self.listings += 1
                self._synced.set()
            except Unreachable:
                again = True
            await self._woken(_RETRY_S if again else RELIST_S)
