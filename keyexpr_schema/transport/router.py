"""A real Zenoh router with the realm's store, in this process.

Values flow through: subscriber and queryable feed bounded channels; one thread applies what
arrived in batches, one answers queries. A query is answered after what arrived before it was
applied, so that a client usually reads its own write at once. Replies carry the exact stored stamp
as text in their attachment, because Python cannot rebuild a `zenoh.Timestamp` exactly.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any

import zenoh
from zenoh import handlers

from keyexpr_schema.errors import CannotListen, SchemaError
from keyexpr_schema.key import Key
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.samples import (
    Encoded,
    decode_value,
    reply_encoding_of,
    stamp_of_text,
    text_of_stamp,
    timestamp_of_stamp,
)
from keyexpr_schema.transport.storage import Store, Write, is_stored
from keyexpr_schema.transport.store_questions import StoreQuestions
from keyexpr_schema.transport.trace import Trace

_log = logging.getLogger(__name__)
CHANNEL = 10_000


class _Storage:
    """Subscribes for a `Store` and replies to queries from it, on two threads."""

    def __init__(self, session: zenoh.Session, store: Store) -> None:
        self._session = session
        self._store = store
        self._questions = StoreQuestions(store)
        self._applying = threading.Lock()
        self._subscriber = session.declare_subscriber("**", handlers.FifoChannel(CHANNEL))
        # Not complete: a complete queryable on `**` would take queries away from those that
        # serve a key.
        self._queryable = session.declare_queryable("**", handlers.FifoChannel(CHANNEL))
        trace = Trace("store")
        for keyexpr, key in self._questions.keys.items():
            trace.note("serve", key, keyexpr)
        self._threads = [
            threading.Thread(target=self._write_for_ever, name="store-write"),
            threading.Thread(target=self._reply_for_ever, name="store-answer"),
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Apply what arrived, then end both threads."""
        self._queryable.undeclare()  # type: ignore[no-untyped-call]
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]
        for thread in self._threads:
            thread.join()

    def _write_for_ever(self) -> None:
        while True:
            try:
                sample = self._subscriber.handler.recv()
            except zenoh.ZError:
                return
            self._apply(sample)

    def _apply(self, sample: zenoh.Sample | None = None) -> None:
        """Apply `sample` and everything else that arrived, in one transaction."""
        with self._applying:
            batch: list[Write] = []
            for _ in range(CHANNEL):
                if sample is not None:
                    self._collect(sample, batch)
                try:
                    sample = self._subscriber.handler.try_recv()
                except zenoh.ZError:
                    break
                if sample is None:
                    break
            if batch:
                try:
                    self._store.apply(batch)
                except Exception:
                    # Not applied means not confirmed: the writers try again.
                    _log.exception("the store could not apply %d writes", len(batch))

    def _collect(self, sample: zenoh.Sample, batch: list[Write]) -> None:
        keyexpr = str(sample.key_expr)
        if not is_stored(keyexpr):
            return
        timestamp = sample.timestamp or self._session.new_timestamp()
        batch.append(
            Write(
                keyexpr,
                stamp_of_text(str(timestamp)),
                sample.kind == zenoh.SampleKind.DELETE,
                str(sample.encoding),
                sample.payload.to_bytes(),
            )
        )

    def _reply_for_ever(self) -> None:
        while True:
            try:
                query = self._queryable.handler.recv()
            except zenoh.ZError:
                return
            with query:
                try:
                    self._reply(query)
                except zenoh.ZError:
                    _log.warning("a reply for %s could not be sent", query.key_expr)
                except Exception as error:
                    _log.exception("the query for %s failed", query.key_expr)
                    with contextlib.suppress(zenoh.ZError):
                        query.reply_err(f"the store failed: {error}".encode())

    def _reply(self, query: zenoh.Query) -> None:
        keyexpr = str(query.key_expr)
        realm, _, rest = keyexpr.partition("/")
        if (key := self._questions.keys.get(rest)) is not None:
            self._apply()
            self._answer(query, realm, key)
            return
        if "*" not in keyexpr and not is_stored(keyexpr):
            return
        self._apply()
        for write in self._store.select(keyexpr):
            query.reply(
                write.keyexpr,
                write.data,
                encoding=write.encoding,
                timestamp=timestamp_of_stamp(write.stamp),
                attachment=text_of_stamp(write.stamp),
            )

    def _answer(self, query: zenoh.Query, realm: str, key: Key[Any, Any]) -> None:
        keyexpr = str(query.key_expr)
        try:
            data = query.payload.to_bytes() if query.payload is not None else b"{}"
            asked = decode_value(key, Encoded(keyexpr, data, str(query.encoding or "")))
        except SchemaError as error:
            query.reply_err(str(error).encode())
            return
        answer = key.encode(self._questions.answer(realm, key, asked))
        query.reply(keyexpr, answer, encoding=reply_encoding_of(key))


@asynccontextmanager
async def run_router(
    listen: Sequence[str],
    connect: Sequence[str] = (),
    store: Store | None = None,
    *,
    lease_s: float = 2.0,
) -> AsyncIterator[None]:
    """A router on the `listen` endpoints, until the block ends.

    `connect` names other routers, which may start later; one of all should have a `store` and the
    others none, because two stores do not align after they were apart.

    Raises:
        CannotListen: an endpoint is taken or not valid.
    """
    try:
        config = zenoh_config("router", listen=listen, connect=connect, lease_s=lease_s)
        config.insert_json5("listen/exit_on_failure", "true")
        # Another router that is away must not keep this one from starting; with a timeout of 0
        # it would be tried once and never again.
        config.insert_json5("connect/timeout_ms", "-1")
        config.insert_json5("connect/exit_on_failure", "false")
        session = await asyncio.shield(asyncio.to_thread(zenoh.open, config))
    except zenoh.ZError as error:
        raise CannotListen(
            f"the router cannot listen on {', '.join(listen)} ({_cause(error)}): is another "
            "program using the port?"
        ) from None
    try:
        storage = await asyncio.to_thread(_Storage, session, store) if store is not None else None
        try:
            yield
        finally:
            if storage is not None:
                await asyncio.shield(asyncio.to_thread(storage.close))
    finally:
        await asyncio.shield(asyncio.to_thread(session.close))


def _cause(error: zenoh.ZError) -> str:
    return str(error).split(" at /")[0].strip().rstrip(".!")
