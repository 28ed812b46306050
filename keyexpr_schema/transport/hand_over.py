"""From Zenoh's threads to the loop: in order, and many at a time where many come."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any


class HandOver:
    """Calls functions on the loop, from any thread, in the order in which they were given.

    Waking the loop costs more than most calls (a handle, a lock, a byte through a socket), so it is
    woken for the first of those that wait only.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._waiting: deque[tuple[Callable[..., object], tuple[Any, ...]]] = deque()
        self._woken = False

    def __call__(self, function: Callable[..., object], *args: Any) -> bool:
        """Call `function(*args)` soon on the loop; whether the loop still runs."""
        if self._loop.is_closed():
            return False
        self._waiting.append((function, args))
        if not self._woken:
            self._woken = True
            try:
                self._loop.call_soon_threadsafe(self._call)
            except RuntimeError:
                return False
        return True

    def _call(self) -> None:
        self._woken = False  # first of all: what is given from now on wakes again
        for _ in range(len(self._waiting)):
            function, args = self._waiting.popleft()
            try:
                function(*args)
            except Exception as error:
                self._loop.call_exception_handler(
                    {"message": f"Exception in {function!r}", "exception": error}
                )
