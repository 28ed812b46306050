"""A query of a process that was frozen: its answer and the end of its time come at once."""

from __future__ import annotations

import asyncio

import pytest

from keyexpr_schema.transport.link import done_within


async def test_an_answer_that_comes_with_the_end_of_its_time_is_an_answer() -> None:
    done: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    asyncio.get_running_loop().call_soon(done.set_result, None)
    await done_within(done, 0.0)
    assert done.done() and not done.cancelled()


async def test_so_is_an_error_and_nothing_is_none() -> None:
    loop = asyncio.get_running_loop()
    failed: asyncio.Future[None] = loop.create_future()
    loop.call_soon(failed.set_exception, TimeoutError("of Zenoh's own"))
    with pytest.raises(TimeoutError, match="of Zenoh's own"):
        await done_within(failed, 0.0)
    never: asyncio.Future[None] = loop.create_future()
    await done_within(never, 0.0)
    assert never.cancelled()
