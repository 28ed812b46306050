"""A process of the fleet runs until it is told to end: by SIGTERM, or SIGINT from a keyboard."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Coroutine
from contextlib import suppress
from typing import Any


def run_until_signal(main: Coroutine[Any, Any, None]) -> None:
    """Run `main` until it returns; a signal cancels it, and then its clean-up is waited for."""

    async def guarded() -> None:
        loop = asyncio.get_running_loop()
        task = asyncio.ensure_future(main)
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, task.cancel)
        with suppress(asyncio.CancelledError):
            await task

    asyncio.run(guarded())
