"""One Zenoh session seen from asyncio: calls that never block the loop.

Zenoh's callbacks run on its own network threads and only schedule a call on the loop. Calls that
may block (a full link, a handshake) run on one thread of their own, in the order in which they were
made, so that a read never overtakes a write.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import AsyncIterator, Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple, TypeVar

import zenoh
from zenoh import handlers

from keyexpr_schema.transport.attachments import Attach, unsigned
from keyexpr_schema.transport.closing import close_session
from keyexpr_schema.transport.hand_over import HandOver
from keyexpr_schema.transport.router_presence import RouterPresence
from keyexpr_schema.transport.samples import (
    Encoded,
    Sample,
    read_sample,
    read_stored,
)
from keyexpr_schema.transport.session_stamps import SessionStamps

_T = TypeVar("_T")
_log = logging.getLogger(__name__)

COLLECTED = 4096
"""So many values of one subscription wait to be collected; of more the oldest are dropped. Zenoh
makes room for all of them, a quarter of a kB each."""

GRACE_S = 2.0
"""Zenoh ends a query at its timeout; one that it has not ended so much later is ended here, since
whoever waits for it may hold up others."""

_TIMED_OUT = b"Timeout"
"""What Zenoh puts into the error reply of a query that ran into its timeout."""


@dataclass
class Replies:
    """What a query brought: values, error replies, and whether all replied in time.

    `by_router` are those of `values` and `errors` that a router has given to which this link goes.
    """

    values: list[Sample] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    timed_out: bool = False
    by_router: Replies | None = None

    def add(self, reply: zenoh.Reply) -> None:
        """Take in one reply, from any thread: a list takes appends from there."""
        if reply.ok is not None:
            self.values.append(read_stored(reply.ok))
        elif reply.err is not None:
            data = reply.err.payload.to_bytes()
            if data == _TIMED_OUT:
                self.timed_out = True
            else:
                self.errors.append(data.decode(errors="replace"))

    def add_of_router(self, reply: zenoh.Reply) -> None:
        """Take in one reply of a router."""
        self.by_router = self.by_router or Replies()
        self.by_router.add(reply)


class Put(NamedTuple):
    """A value for a key, or with `data` None its deletion; `said_s`: since when it waits, on the
    clock of `time.monotonic`, if the store is to know that."""

    keyexpr: str
    data: bytes | None
    encoding: str
    timestamp: zenoh.Timestamp
    said_s: float | None = None


@dataclass(frozen=True)
class IncomingQuery(Encoded):
    """A query to be ended with `reply` or `refuse`, once."""

    link: Link
    query: zenoh.Query

    async def reply(self, data: bytes, encoding: str) -> None:
        """Send the reply and end the query."""
        await self.link.call(
            self._end, lambda: self.query.reply(self.keyexpr, data, encoding=encoding)
        )

    async def refuse(self, reason: str) -> None:
        """Send an error reply and end the query."""
        await self.link.call(
            self._end, lambda: self.query.reply_err(reason.encode(), encoding="text/plain")
        )

    def _end(self, send: Callable[[], object]) -> None:
        # A client whom the reply cannot reach any more sees that by its own timeout.
        with contextlib.suppress(zenoh.ZError), self.query:
            send()


class Link:
    """A Zenoh client session; made by `connecting.open_link`."""

    def __init__(self, session: zenoh.Session, executor: ThreadPoolExecutor) -> None:
        self._session = session
        self._executor = executor
        self.stamps = SessionStamps(session)
        self._loop = asyncio.get_running_loop()
        self._call_soon = HandOver(self._loop)
        self._queriers: dict[str, zenoh.Querier] = {}
        self.attach: Attach = unsigned
        self.router = RouterPresence()
        self._stored_here: frozenset[str] | None = None
        """The routers to which this link went when one of them answered as the store."""
        self._events = session.info.declare_transport_events_listener(
            handlers.Callback(self._on_transport, indirect=False), history=True
        )

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        if event.transport.whatami == zenoh.WhatAmI.ROUTER:
            opened = event.kind == zenoh.SampleKind.PUT
            self._call_soon(self.router.count, str(event.transport.zid), opened)

    # --- threads ---------------------------------------------------------------------------------

    async def call(self, function: Callable[..., _T], *args: Any) -> _T:
        """Run a blocking Zenoh call on the link's thread, after those made before it."""
        return await self._loop.run_in_executor(self._executor, function, *args)

    # --- values ----------------------------------------------------------------------------------

    def new_timestamp(self) -> zenoh.Timestamp:
        """A timestamp of this session's hybrid logical clock, later than all before it."""
        return self.stamps.new()

    def send_soon(self, keyexpr: str, data: bytes, encoding: str, *, block: bool) -> None:
        """Put and forget. `block`: wait (on the link's thread) when the link is full; else drop."""
        if not block:
            drop = zenoh.CongestionControl.DROP
            self._session.put(keyexpr, data, encoding=encoding, congestion_control=drop)
            return
        self.send_together([Put(keyexpr, data, encoding, self.new_timestamp())])

    def send_together(self, puts: Sequence[Put]) -> None:
        """Put these and forget; wait (on the link's thread) when the link is full."""
        for put in puts:
            self._executor.submit(self._send, put).add_done_callback(_log_failure)

    async def send(self, put: Put) -> None:
        """Put and wait until it is on the link, not until it is stored."""
        await self.call(self._send, put)

    def _send(self, put: Put) -> None:
        keyexpr, data, encoding, timestamp, said_s = put
        how: dict[str, Any] = {
            "timestamp": timestamp,
            "congestion_control": zenoh.CongestionControl.BLOCK,
        }
        late_us = None if said_s is None else round(max(0.0, time.monotonic() - said_s) * 1e6)
        if (attached := self.attach(keyexpr, str(timestamp), data, late_us)) is not None:
            how["attachment"] = attached
        if data is None:
            self._session.delete(keyexpr, **how)
        else:
            self._session.put(keyexpr, data, encoding=encoding, **how)

    async def query(
        self,
        keyexpr: str,
        timeout_s: float,
        data: bytes | None = None,
        encoding: str | None = None,
        *,
        first: bool = False,
        stored: bool = False,
        after: Sequence[Put] = (),
        attached: str | None = None,
    ) -> Replies:
        """Query everyone who replies for `keyexpr`; `first`: return with the first value.

        `stored`: only a store's replies count. Where the store is that of a router to which this
        link goes, no other's count from then on; else (it is behind another router, or a zenohd's)
        whoever replies is believed. The puts of `after` go down the link before it.
        """
        replies = Replies()
        done: asyncio.Future[None] = self._loop.create_future()

        def finish(error: Exception | None = None) -> None:
            if not done.done():
                done.set_result(None) if error is None else done.set_exception(error)

        def on_reply(reply: zenoh.Reply) -> None:
            replies.add(reply)
            of_router = stored and self._is_of_router(reply)
            if of_router:
                replies.add_of_router(reply)
            if first and reply.ok is not None and of_router == stored:
                self._call_soon(finish)

        def get() -> None:
            try:
                for put in after:
                    self._send(put)
                self._session.get(
                    keyexpr,
                    handlers.Callback(on_reply, lambda: self._call_soon(finish), indirect=False),
                    target=zenoh.QueryTarget.ALL,
                    consolidation=zenoh.ConsolidationMode.NONE,
                    timeout=timeout_s,
                    payload=data,
                    encoding=encoding,
                    attachment=attached,
                    congestion_control=zenoh.CongestionControl.BLOCK,
                )
            except Exception as error:
                self._call_soon(finish, error)

        started_s = self._loop.time()
        self._executor.submit(get)
        await done_within(done, timeout_s + GRACE_S)
        # The router's own clock may end a query first, and then without an error reply.
        if not replies.values and self._loop.time() - started_s >= 0.9 * timeout_s:
            replies.timed_out = True
        if stored and (replies.by_router is not None or self._stored_here == self.router.linked):
            self._stored_here = self.router.linked
            believed = replies.by_router or Replies()
            whole = "*" not in keyexpr and bool(believed.values)
            return replace(believed, timed_out=replies.timed_out and not whole)
        return replies

    def _is_of_router(self, reply: zenoh.Reply) -> bool:
        replier = reply.replier_id
        return replier is not None and str(replier.zid) in self.router.linked

    async def served(self, keyexpr: str, within_s: float) -> bool:
        """Whether somebody answers queries for `keyexpr`, or comes to be known within that time: a
        link hears of that some milliseconds after it is up."""

        def matching() -> bool:
            if keyexpr not in self._queriers:
                self._queriers[keyexpr] = self._session.declare_querier(keyexpr)
            status: Any = self._queriers[keyexpr].matching_status  # typed as bool, and is none
            return bool(status.matching)

        until_s, pause_s = self._loop.time() + within_s, 0.001
        while not await self.call(matching):
            if self._loop.time() >= until_s:
                return False
            await asyncio.sleep(pause_s)
            pause_s = min(0.05, 2 * pause_s)
        return True

    def subscribed(
        self, keyexpr: str, receive: Callable[[Sample], None]
    ) -> AbstractAsyncContextManager[None]:
        """Call `receive` on the loop with every value and deletion that passes."""
        callback = self._callback(receive)
        return self._declared(lambda: self._session.declare_subscriber(keyexpr, callback))

    def queryable(
        self, keyexpr: str, receive: Callable[[IncomingQuery], None]
    ) -> AbstractAsyncContextManager[None]:
        """Call `receive` on the loop with every query for `keyexpr`."""

        def on_query(query: zenoh.Query) -> None:
            data = query.payload.to_bytes() if query.payload is not None else b""
            encoding = str(query.encoding) if query.encoding is not None else ""
            incoming = IncomingQuery(str(query.key_expr), data, encoding, self, query)
            if not self._call_soon(receive, incoming):
                query.drop()  # type: ignore[no-untyped-call]

        callback = handlers.Callback(on_query, indirect=False)
        return self._declared(lambda: self._session.declare_queryable(keyexpr, callback))

    # --- liveliness ------------------------------------------------------------------------------

    def token(self, keyexpr: str) -> AbstractAsyncContextManager[None]:
        """Hold a liveliness token; Zenoh declares it again after every reconnection."""
        return self._declared(lambda: self._session.liveliness().declare_token(keyexpr))

    async def tokens(self, keyexpr: str, timeout_s: float) -> Replies:
        """The liveliness tokens there are now."""

        def get() -> Replies:
            # A channel of the default size deadlocks past 256 tokens when the session also has
            # a liveliness subscriber.
            channel: handlers.FifoChannel[zenoh.Reply] = handlers.FifoChannel(100_000)
            replies = Replies()
            for reply in self._session.liveliness().get(keyexpr, channel, timeout=timeout_s):
                replies.add(reply)
            return replies

        return await asyncio.to_thread(get)

    def tokens_watched(
        self, keyexpr: str, receive: Callable[[Sample], None]
    ) -> AbstractAsyncContextManager[None]:
        """Call `receive` on the loop with tokens that come (those there already, too) and go."""
        callback = self._callback(receive)
        return self._declared(
            lambda: self._session.liveliness().declare_subscriber(keyexpr, callback, history=True)
        )

    @asynccontextmanager
    async def collected(
        self, receivers: Sequence[tuple[str, Callable[[Sample], None]]]
    ) -> AsyncIterator[Callable[[], bool]]:
        """Subscribe to key expressions; values wait until the function that this yields is called.

        It passes on all that wait, by their timestamps, and says whether some may be lost. Zenoh's
        threads wait for no Python, and the loop is not woken for each value: for those who are in
        no hurry, and ask for what they missed.
        """
        async with contextlib.AsyncExitStack() as stack:
            receiving = []
            for keyexpr, receive in receivers:
                declare = partial(
                    self._session.declare_subscriber, keyexpr, handlers.RingChannel(COLLECTED)
                )
                subscriber = await stack.enter_async_context(self._declared(declare))
                receiving.append((subscriber.handler, receive))

            def collect() -> bool:
                lost = False
                waiting: list[tuple[Sample, Callable[[Sample], None]]] = []
                for arrived, receive in receiving:
                    had = len(waiting)
                    with contextlib.suppress(zenoh.ZError):  # the block has ended, or the session
                        while (sample := arrived.try_recv()) is not None:
                            waiting.append((read_sample(sample), receive))
                    lost |= len(waiting) - had >= COLLECTED
                for value, receive in sorted(waiting, key=lambda one: one[0].stamp):
                    receive(value)
                return lost

            yield collect

    def _callback(self, receive: Callable[[Sample], None]) -> Any:
        return handlers.Callback(
            lambda sample: self._call_soon(receive, read_sample(sample)), indirect=False
        )

    @asynccontextmanager
    async def _declared(self, declare: Callable[[], Any]) -> AsyncIterator[Any]:
        future = self._executor.submit(declare)
        try:
            yield await asyncio.wrap_future(future)
        finally:
            # The declaration may have happened although its waiter was cancelled.
            future.cancel()

            def undeclare() -> None:
                if not future.cancelled() and future.exception() is None:
                    future.result().undeclare()

            with contextlib.suppress(RuntimeError):  # the session closed first, and undeclared it
                await asyncio.shield(self.call(undeclare))

    def close(self) -> None:
        """Close the session; blocks for a moment. What was sent before goes out first."""
        with contextlib.suppress(zenoh.ZError):
            self._events.undeclare()  # type: ignore[no-untyped-call]
        close_session(self._session)


async def done_within(done: asyncio.Future[None], timeout_s: float) -> None:
    """Wait for `done` so long at most. A process that was frozen finds both at once: the time over,
    and the answer there.

    Raises:
        Exception: that of `done`.
    """
    try:
        async with asyncio.timeout(timeout_s):
            await done
    except TimeoutError:
        if done.done() and not done.cancelled():
            done.result()


def _log_failure(future: Any) -> None:
    if not future.cancelled() and future.exception() is not None:
        _log.warning("a put was lost: %s", future.exception())
