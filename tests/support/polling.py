"""Waiting for a condition: no test sleeps instead."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from keyexpr_schema.errors import Unreachable

DEADLINE_S = 240.0
"""Longer than any command waits by itself, so that its own sentence is what a test shows."""
BETWEEN_LOOKS_S = 0.01


async def until(look: Callable[[], Any], what: str = "it", timeout_s: float = DEADLINE_S) -> Any:
    """The first true answer of `look`, which may be a coroutine function; a store that did not
    answer in time is asked again."""
    try:
        async with asyncio.timeout(timeout_s):
            while True:
                with suppress(Unreachable):
                    found = look()
                    if inspect.isawaitable(found):
                        found = await found
                    if found:
                        return found
                await asyncio.sleep(BETWEEN_LOOKS_S)
    except TimeoutError:
        pytest.fail(f"{what} did not come within {timeout_s:g} s")
