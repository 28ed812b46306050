"""Time that passes only when nothing else happens: hours of waiting in no time.

Whoever runs here reads the clock of the host that his task is on (`on_host`), which may be wrong.
"""

from __future__ import annotations

import asyncio
import random
import secrets
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from functools import partial
from typing import Any, TypeVar
from unittest.mock import patch

from benchmarks.planning.simulated_time import SimulatedLoop
from fleet.stores import sqlite
from fleet.stores.receipts import ReceiptClock

T = TypeVar("T")
EPOCH_S = 1_800_000_000.0
"""When it begins (Unix)."""
_NS = 1_000_000_000


class Clock:
    """The clock of a host, `ahead_s` of what time it is."""

    def __init__(self, ahead_s: float = 0.0) -> None:
        self.ahead_s = ahead_s

    def now_s(self) -> float:
        return EPOCH_S + asyncio.get_running_loop().time() + self.ahead_s

    def now_ns(self) -> int:
        return int(self.now_s() * _NS)


_RIGHT = Clock()
_HOST: ContextVar[Clock] = ContextVar("host", default=_RIGHT)


@contextmanager
def on_host(clock: Clock) -> Iterator[None]:
    """In the block, and in the tasks that it starts, it is as late as that clock says."""
    token = _HOST.set(clock)
    try:
        yield
    finally:
        _HOST.reset(token)


def passing(seconds: float) -> asyncio.Future[None]:
    """To be awaited: so much time passes."""
    loop = asyncio.get_running_loop()
    over: asyncio.Future[None] = loop.create_future()
    loop.call_later(seconds, lambda: over.done() or over.set_result(None))
    return over


def lived(life: Callable[[], Coroutine[Any, Any, T]], seed: int = 0) -> T:
    """What comes of `life`, run in virtual time; what is drawn at random is the same each time."""
    with ExitStack() as stack:
        loop = SimulatedLoop(begins_s=1_000.0)
        stack.callback(loop.close)
        monotonic_ns = lambda: int(loop.time() * _NS)  # noqa: E731
        for what, name, instead in (
            (time, "time", lambda: _HOST.get().now_s()),
            (time, "monotonic", loop.time),
            (secrets, "token_bytes", random.Random(seed).randbytes),
            (sqlite, "ReceiptClock", partial(ReceiptClock, monotonic_ns=monotonic_ns)),
        ):
            stack.enter_context(patch.object(what, name, instead))
        return loop.run_until_complete(life())
