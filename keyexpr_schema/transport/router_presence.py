"""Whether a router is in view, as Zenoh's transport events say."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class RouterPresence:
    """Whether a router is in view now, since when, and for how manieth time.

    `generation` counts how often a router came into view: what was learned in one generation
    says nothing about the next.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._transports: dict[str, int] = {}
        self._up = asyncio.Event()
        self._up_since_s = 0.0
        self._listeners: list[Callable[[], None]] = []
        self.generation = 0
        self._linked: frozenset[str] = frozenset()

    @property
    def up(self) -> bool:
        """Whether a router is in view now."""
        return self._up.is_set()

    @property
    def age_s(self) -> float:
        """Seconds since a router came into view; 0 while there is none."""
        return self._loop.time() - self._up_since_s if self.up else 0.0

    @property
    def linked(self) -> frozenset[str]:
        """The ids of the routers in view now."""
        return self._linked

    async def wait_up(self, timeout_s: float | None = None) -> None:
        """Wait until a router is in view.

        Raises:
            TimeoutError: none was within `timeout_s`.
        """
        async with asyncio.timeout(timeout_s):
            await self._up.wait()

    async def wait_after(self, generation: int) -> None:
        """Wait until a router has come into view again after that generation."""
        changed = asyncio.Event()
        with self.listening(changed.set):
            while self.generation == generation:
                changed.clear()
                await changed.wait()

    @contextmanager
    def listening(self, listener: Callable[[], None]) -> Iterator[None]:
        """Call `listener` on the loop whenever a router comes into view or goes out of it."""
        self._listeners.append(listener)
        try:
            yield
        finally:
            self._listeners.remove(listener)

    def count(self, zid: str, opened: bool) -> None:
        """Take in that a transport to the router `zid` was opened or closed."""
        # A fast reconnection can show the new transport before the end of the old one.
        self._transports[zid] = self._transports.get(zid, 0) + (1 if opened else -1)
        if not self._transports[zid]:
            del self._transports[zid]
        self._linked = frozenset(self._transports)
        if opened:
            self.generation += 1
            self._up_since_s = self._loop.time()
        if any(count > 0 for count in self._transports.values()):
            self._up.set()
        else:
            self._up.clear()
        for listener in list(self._listeners):
            listener()
