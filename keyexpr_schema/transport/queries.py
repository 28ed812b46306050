"""The two ends of a `QUERY` key: who serves it, and who sends a query."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any, Generic, cast

from keyexpr_schema.errors import NoReply, SchemaError, UndecodablePayload
from keyexpr_schema.key import A, Key, P, Payload
from keyexpr_schema.transport.link import IncomingQuery, Link
from keyexpr_schema.transport.samples import (
    decode_reply,
    decode_value,
    encoding_of,
    reply_encoding_of,
)
from keyexpr_schema.transport.undecodable import UndecodableReports


class QueryServer(Generic[A, P]):
    """Replies to the queries on one key with what `handler` returns, several at a time."""

    def __init__(
        self,
        link: Link,
        component: str,
        undecodable: UndecodableReports,
        key: Key[A, P],
        handler: Callable[[A, P], Awaitable[Payload]],
    ) -> None:
        self._link, self._component, self._undecodable = link, component, undecodable
        self._key, self._handler = key, handler
        self._tasks: set[asyncio.Task[None]] = set()
        self._ended = False

    @asynccontextmanager
    async def running(self, pattern: str) -> AsyncIterator[None]:
        """Serve until the block ends; what has no reply by then is refused."""
        try:
            async with self._link.queryable(pattern, self._receive):
                yield
        finally:
            self._ended = True
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)

    def _receive(self, query: IncomingQuery) -> None:
        if self._ended:  # it had come, and waited for the loop
            query.query.drop()  # type: ignore[no-untyped-call]
            return
        task = asyncio.create_task(self._reply(query))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _reply(self, query: IncomingQuery) -> None:
        key = self._key
        try:
            address = key.parse(query.keyexpr)
            reply = await self._handler(address, decode_value(key, query))
        except asyncio.CancelledError:
            await asyncio.shield(query.refuse(f"{self._component} is going away"))
            raise
        except UndecodablePayload as error:
            self._undecodable.report(query.keyexpr, query.data, str(error))
            await query.refuse(str(error))
        except SchemaError as error:
            await query.refuse(str(error))
        except Exception as error:  # whatever a handler raises is a reply, too
            await query.refuse(f"{self._component} failed: {str(error) or type(error).__name__}")
        else:
            await query.reply(key.encode(cast(Any, reply)), reply_encoding_of(key))


async def send_query(link: Link, key: Key[A, P], address: A, payload: P, timeout_s: float) -> Any:
    """The reply to `payload`, of type `key.reply`.

    Raises:
        NoReply: nobody serves it, it failed, or it took longer than `timeout_s`.
    """
    if key.reply is None:
        raise TypeError(f"{key.name} is {key.delivery.value}: it cannot be asked")
    keyexpr = key.build(address)
    replies = await link.query(
        keyexpr, timeout_s, key.encode(payload), encoding_of(key), first=True
    )
    if replies.values:
        try:
            return decode_reply(key, replies.values[0])
        except UndecodablePayload as error:
            raise NoReply(f"the answer of {keyexpr} cannot be read: {error}") from None
    if replies.errors:
        raise NoReply(f"{keyexpr}: {replies.errors[0]}")
    if replies.timed_out:
        raise NoReply(f"{keyexpr} did not answer within {timeout_s:g} s")
    if not link.router.up:
        raise NoReply(f"{keyexpr} cannot be asked: no router answers")
    raise NoReply(f"nobody serves {keyexpr}: the process that answers it is not running")
