"""The store behind a router: takes in what is put, and answers from a `Store`.

Values flow through: subscriber and queryable feed bounded channels; one thread applies what
arrived in batches, one answers queries. A query is answered after what arrived before it was
applied, so that a client usually reads its own write at once. Replies carry the exact stored stamp
as text in their attachment, because Python cannot rebuild a `zenoh.Timestamp` exactly.
"""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable
from typing import Any

import zenoh
from zenoh import handlers

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.key import Key
from keyexpr_schema.transport.samples import (
    Encoded,
    decode_value,
    reply_encoding_of,
    stamp_of_text,
    text_of_stamp,
    timestamp_of_stamp,
)
from keyexpr_schema.transport.store.questions import StoreQuestions
from keyexpr_schema.transport.store.storage import Store, Write, is_stored
from keyexpr_schema.transport.trace import Trace

_log = logging.getLogger(__name__)
CHANNEL = 10_000
IN_HAND_S = 0.01
"""How long an answer waits for a put that its asker has sent: the other thread may have it."""


class StoreServer:
    """Subscribes for a `Store` and replies to queries from it, on two threads."""

    def __init__(self, session: zenoh.Session, store: Store) -> None:
        self._session = session
        self._store = store
        self._questions = StoreQuestions(store, self._arrived, self._write)
        self._applying = threading.Condition()
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

    # --- writing ---------------------------------------------------------------------------------

    def _write_for_ever(self) -> None:
        while True:
            try:
                sample = self._subscriber.handler.recv()
            except zenoh.ZError:
                return
            with self._applying:
                self._apply(sample)
                self._applying.notify_all()

    def _apply(self, sample: zenoh.Sample | None = None) -> None:
        """Apply `sample` and everything else that arrived, in one transaction; with the lock."""
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

    def _arrived(self, condition: Callable[[], bool]) -> None:
        """Give what a condition waits for, and was put before the query that asks, a moment."""
        with self._applying:
            self._applying.wait_for(condition, IN_HAND_S)

    def _write(self, keyexpr: str, encoding: str, data: bytes, allowed: Callable[[], bool]) -> bool:
        """Write a key for somebody, if that is `allowed` when nothing else is written; whether.

        Every subscriber sees it as a put of this moment.

        Raises:
            SchemaError: what was written there last is from a clock that is too far ahead.
            Exception: the store could not write it.
        """
        with self._applying:
            self._apply()
            if not allowed():
                return False
            newest = self._store.newest([keyexpr])[0]
            there = newest.stamp if newest is not None else 0
            timestamp = self._session.new_timestamp()
            if (stamp := stamp_of_text(str(timestamp))) <= there:
                raise SchemaError(
                    f"{keyexpr.partition('/')[2]} was last written by a clock that is ahead of "
                    f"the store's ({text_of_stamp(there)}); set the clocks right"
                )
            self._store.apply([Write(keyexpr, stamp, False, encoding, data)])
        # Without the lock, and not to ourselves: a full channel would never be emptied.
        self._session.put(
            keyexpr,
            data,
            encoding=encoding,
            timestamp=timestamp,
            congestion_control=zenoh.CongestionControl.BLOCK,
            allowed_destination=zenoh.Locality.REMOTE,
        )
        return True

    # --- answering -------------------------------------------------------------------------------

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
                except SchemaError as error:
                    with contextlib.suppress(zenoh.ZError):
                        query.reply_err(str(error).encode())
                except Exception as error:
                    _log.exception("the query for %s failed", query.key_expr)
                    with contextlib.suppress(zenoh.ZError):
                        query.reply_err(f"the store failed: {error}".encode())

    def _reply(self, query: zenoh.Query) -> None:
        keyexpr = str(query.key_expr)
        realm, _, rest = keyexpr.partition("/")
        key = self._questions.keys.get(rest)
        if key is None and "*" not in keyexpr and not is_stored(keyexpr):
            return
        with self._applying:
            self._apply()
        if key is not None:
            self._answer(query, realm, key)
            return
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
        data = query.payload.to_bytes() if query.payload is not None else b"{}"
        asked = decode_value(key, Encoded(keyexpr, data, str(query.encoding or "")))
        answer = key.encode(self._questions.answer(realm, key, asked))
        query.reply(keyexpr, answer, encoding=reply_encoding_of(key))
