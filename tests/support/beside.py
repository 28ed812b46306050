"""What runs beside a test for as long as a block lasts."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from typing import Any


@asynccontextmanager
async def running_beside(
    work: Coroutine[Any, Any, None], what: str
) -> AsyncIterator[asyncio.Task[None]]:
    """Run it until the block ends, which cancels it; it must not have ended by itself."""
    task = asyncio.create_task(work)
    try:
        yield task
    finally:
        task.cancel()
        (ended,) = await asyncio.gather(task, return_exceptions=True)
        if not isinstance(ended, asyncio.CancelledError):
            raise RuntimeError(f"{what} ended by itself") from ended
