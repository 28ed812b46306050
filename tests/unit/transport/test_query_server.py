"""A server of queries that has ended."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any

from keyexpr_schema.keyspace import STORE_CLOCK
from keyexpr_schema.transport.queries import QueryServer


class Link:
    """A link on which queries are passed on by hand."""

    receive: Callable[[Any], None]

    @asynccontextmanager
    async def queryable(self, _: str, receive: Callable[[Any], None]) -> AsyncIterator[None]:
        self.receive = receive
        yield


async def nobody(*_: Any) -> Any:
    raise AssertionError("nobody asks any more")


async def test_what_waited_for_the_loop_when_it_ended_is_dropped() -> None:
    """Its process may be ending: nothing can be sent any more."""
    link: Any = Link()
    server = QueryServer(link, "test", SimpleNamespace(), STORE_CLOCK, nobody)
    async with server.running("store/clock"):
        tasks = asyncio.all_tasks()
    dropped: list[bool] = []
    link.receive(SimpleNamespace(query=SimpleNamespace(drop=lambda: dropped.append(True))))
    assert dropped == [True]
    assert asyncio.all_tasks() == tasks
