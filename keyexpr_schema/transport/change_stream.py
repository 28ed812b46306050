"""An async iterator that is filled in the background: what watches of keys and of tokens share."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager, suppress
from typing import Any, Generic, Self, TypeVar

T = TypeVar("T")


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
