"""Questions and answers: the two ends of a `Delivery.QUERY` key."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any, Generic, cast

from keyexpr_schema.errors import NoAnswer, SchemaError, UndecodablePayload
from keyexpr_schema.key import SCHEMA_PREFIX, A, Key, P, Payload
from keyexpr_schema.transport.link import Link, Request
from keyexpr_schema.transport.watch import Reader
from keyexpr_schema.transport.wire import decode_wire, encoding_of

REPLY_VERSION = 1


def reply_name(key: Key[Any, Any]) -> str:
    """The schema name of answers on `key`."""
    return f"{key.name}_reply"


def reply_encoding(key: Key[Any, Any]) -> str:
    """The Zenoh encoding of answers on `key`."""
    return encoding_of(f"{SCHEMA_PREFIX}/{reply_name(key)}/{REPLY_VERSION}")


class Service(Generic[A, P]):
    """Answers the questions on one key with `handler`, several at a time."""

    def __init__(
        self, reader: Reader, key: Key[A, P], handler: Callable[[A, P], Awaitable[Payload]]
    ) -> None:
        self._reader, self._key, self._handler = reader, key, handler
        self._tasks: set[asyncio.Task[None]] = set()

    @asynccontextmanager
    async def running(self, pattern: str) -> AsyncIterator[None]:
        """Answer until the block ends; what is unanswered then is refused."""
        try:
            async with self._reader.link.answering(pattern, self._receive):
                yield
        finally:
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)

    def _receive(self, request: Request) -> None:
        task = asyncio.create_task(self._answer(request))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _answer(self, request: Request) -> None:
        key, who = self._key, self._reader.component
        try:
            address = key.parse(request.keyexpr)
            question = decode_wire(
                request.data,
                request.encoding,
                key.payload,
                key.name,
                key.version,
                request.keyexpr,
            )
            answer = await self._handler(address, question)
        except asyncio.CancelledError:
            await asyncio.shield(request.refuse(f"{who} is going away"))
            raise
        except UndecodablePayload as error:
            self._reader.reject(request.keyexpr, request.data, str(error))
            await request.refuse(str(error))
        except SchemaError as error:
            await request.refuse(str(error))
        except Exception as error:  # whatever a handler raises is an answer, too
            await request.refuse(f"{who} failed: {str(error) or type(error).__name__}")
        else:
            await request.answer(key.encode(cast(Any, answer)), reply_encoding(key))


async def ask(link: Link, key: Key[A, P], address: A, payload: P, timeout_s: float) -> Any:
    """The answer to `payload`, of type `key.reply`.

    Raises:
        NoAnswer: nobody serves it, it failed, or it took longer than `timeout_s`.
    """
    if key.reply is None:
        raise TypeError(f"{key.name} is {key.delivery.value}: it cannot be asked")
    keyexpr = key.build(address)
    replies = await link.query(
        keyexpr, timeout_s, key.encode(payload), encoding_of(key.schema), first=True
    )
    if replies.values:
        wire = replies.values[0]
        try:
            return decode_wire(
                wire.data, wire.encoding, key.reply, reply_name(key), REPLY_VERSION, keyexpr
            )
        except UndecodablePayload as error:
            raise NoAnswer(f"the answer of {keyexpr} cannot be read: {error}") from None
    if replies.errors:
        raise NoAnswer(f"{keyexpr}: {replies.errors[0]}")
    if replies.timed_out:
        raise NoAnswer(f"{keyexpr} did not answer within {timeout_s:g} s")
    if not link.up:
        raise NoAnswer(f"{keyexpr} cannot be asked: no router answers")
    raise NoAnswer(f"nobody serves {keyexpr}: the process that answers it is not running")
