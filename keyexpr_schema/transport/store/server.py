"""The store behind a router: takes in what is put, and answers from a `Store`.

Values flow through: subscriber and queryable feed bounded channels; one thread applies what
arrived in batches, one answers queries. A query is answered after what arrived before it was
applied: the answering thread sends a mark through the channel of the values and waits until the
other one has come to it. So values are applied in the order in which they came, and a client reads
its own writes. Replies carry the exact stored stamp as text in their attachment, because Python
cannot rebuild a `zenoh.Timestamp` exactly.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import uuid
from collections.abc import Callable, Sequence
from sys import intern
from typing import Any

import zenoh
from zenoh import handlers

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.key import Address, Key
from keyexpr_schema.keyspace import STORE_STAMPS
from keyexpr_schema.payloads.system import StoreAddress
from keyexpr_schema.transport.attachments import Attach, Attachment, unsigned
from keyexpr_schema.transport.credentials import Credentials
from keyexpr_schema.transport.samples import (
    Encoded,
    attached_to,
    decode_value,
    reply_encoding_of,
    stamped_s,
    timestamp_of_stamp,
)
from keyexpr_schema.transport.stamps import stamp_of_text, text_of_stamp
from keyexpr_schema.transport.store.admission import Admission
from keyexpr_schema.transport.store.questions import ClockBehind, StoreQuestions
from keyexpr_schema.transport.store.storage import (
    Store,
    Write,
    deletes_tree,
    is_by_receipt,
    is_stored,
)
from keyexpr_schema.transport.trace import Trace

_log = logging.getLogger(__name__)
CHANNEL = 10_000
_STAMPS = f"/{STORE_STAMPS.build(StoreAddress())}"
QUERIES = 64
"""Queries that are answered after one mark, at most."""


class StoreServer:
    """Subscribes for a `Store` and replies to queries from it, on two threads."""

    def __init__(
        self, session: zenoh.Session, store: Store, credentials: Credentials | None = None
    ) -> None:
        self._session = session
        self._store = store
        self._attach: Attach = unsigned
        if credentials is not None and credentials.signer is not None:
            self._attach = credentials.signer.attachment
        self._admission = Admission(
            store,
            stamped_s=lambda: stamped_s(session),
            authority=None if credentials is None else credentials.authority,
        )
        self._questions = StoreQuestions(store, self._write, self._admission)
        self._applying = threading.Lock()
        self._mark = f"mark-{uuid.uuid4().hex}"
        self._marks = 0
        self._wide = 0
        self._reached = 0
        self._at_mark = threading.Condition()
        self._subscriber = session.declare_subscriber("**", handlers.FifoChannel(CHANNEL))
        # Not complete: a complete queryable on `**` would take queries away from those that
        # serve a key.
        self._queryable = session.declare_queryable("**", handlers.FifoChannel(CHANNEL))
        trace = Trace("store")
        for key in self._questions.keys:
            trace.note("serve", key, key.pattern())
        self._writing = threading.Thread(target=self._write_for_ever, name="store-write")
        self._answering = threading.Thread(target=self._reply_for_ever, name="store-answer")
        self._writing.start()
        self._answering.start()

    def close(self) -> None:
        """Apply what arrived, then end both threads."""
        self._queryable.undeclare()  # type: ignore[no-untyped-call]
        self._answering.join()
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]
        self._writing.join()

    # --- writing ---------------------------------------------------------------------------------

    def _write_for_ever(self) -> None:
        while True:
            try:
                sample: zenoh.Sample | None = self._subscriber.handler.recv()
            except zenoh.ZError:
                return
            batch: list[Write] = []
            mark = 0
            while sample is not None:
                try:
                    mark = self._collect(sample, batch) or mark
                except Exception:
                    _log.exception("the store could not take in what is at %s", sample.key_expr)
                # What is taken out of the channel is taken in: look at the size before.
                sample = None
                if len(batch) < CHANNEL:
                    with contextlib.suppress(zenoh.ZError):
                        sample = self._subscriber.handler.try_recv()
            self._apply(batch)
            if mark:
                with self._at_mark:
                    self._reached = mark
                    self._at_mark.notify()

    def _apply(self, batch: list[Write]) -> None:
        """Apply `batch` in one transaction."""
        if not batch:
            return
        # Not applied means not confirmed: the writers try again, and hear why.
        with self._applying, contextlib.suppress(SchemaError):
            if admitted := self._admission.admitted(batch):
                self._apply_or_say(admitted)

    def _apply_or_say(self, batch: list[Write]) -> None:
        """Apply `batch`, for whoever holds the lock.

        Raises:
            SchemaError: nothing of it could be; the log and the store's answers say so.
        """
        try:
            self._store.apply(batch)
        except Exception as error:
            self._admission.uncertain()
            self._questions.fails(error)
            raise SchemaError(f"{error}; free some room for the router's store") from error
        self._questions.works()

    def _wait_for_what_arrived(self) -> None:
        """Return when everything is applied that came before this call."""
        self._marks += 1
        self._session.put(
            self._mark, str(self._marks), allowed_destination=zenoh.Locality.SESSION_LOCAL
        )
        with self._at_mark:
            self._at_mark.wait_for(lambda: self._reached >= self._marks)

    def _collect(self, sample: zenoh.Sample, batch: list[Write]) -> int:
        """Add `sample` to `batch` if it is to be stored; the number of a mark, if it is one."""
        keyexpr = str(sample.key_expr)
        deleted = sample.kind == zenoh.SampleKind.DELETE
        if not is_stored(keyexpr) and not (deleted and deletes_tree(keyexpr)):
            if keyexpr == self._mark:
                return int(sample.payload.to_string())
            if "*" in keyexpr:
                self._refuse_wildcards(keyexpr)
            return 0
        timestamp = sample.timestamp or self._session.new_timestamp()
        stamp = stamp_of_text(str(timestamp))
        if not self._admission.takes(keyexpr, stamp, len(sample.payload)):
            return 0
        attachment = Attachment.read(attached_to(sample))
        write = Write(
            keyexpr,
            stamp,
            deleted,
            intern(str(sample.encoding)),  # there are a few
            sample.payload.to_bytes(),
            attachment.late_us or 0,
        )
        if self._admission.believes(write, attachment):
            batch.append(write)
        return 0

    def _refuse_wildcards(self, keyexpr: str) -> None:
        self._wide += 1
        if self._wide in (1, 10, 100) or self._wide % 1000 == 0:
            _log.warning(
                "somebody has written %s: with wildcards only what is about one plan, goal or "
                "request is deleted; %d such writes were left out so far",
                keyexpr,
                self._wide,
            )

    def _write(self, keyexpr: str, encoding: str, data: bytes, allowed: Callable[[], bool]) -> bool:
        """Write a key for somebody, if that is `allowed` when nothing else is written; whether.

        Every subscriber sees it as a put of this moment.

        Raises:
            ClockBehind: whoever wrote it last had a clock ahead of ours.
            SchemaError: the store could not write it.
        """
        with self._applying:
            if not allowed():
                return False
            newest = self._store.newest([keyexpr])[0]
            timestamp = self._session.new_timestamp()
            stamp = stamp_of_text(str(timestamp))
            late = newest is not None and newest.stamp >= stamp
            if newest is not None and late and not is_by_receipt(keyexpr):
                raise ClockBehind(newest.stamp, stamp)
            write = Write(keyexpr, stamp, False, encoding, data)
            if (why := self._admission.why_not(write)) is not None:
                raise SchemaError(why)
            self._apply_or_say([write])
        # Without the lock, and not to ourselves: a full channel would never be emptied.
        self._session.put(
            keyexpr,
            data,
            encoding=encoding,
            timestamp=timestamp,
            attachment=self._attach(keyexpr, str(timestamp), data, None),
            congestion_control=zenoh.CongestionControl.BLOCK,
            allowed_destination=zenoh.Locality.REMOTE,
        )
        return True

    # --- answering -------------------------------------------------------------------------------

    def _reply_for_ever(self) -> None:
        while True:
            queries: list[zenoh.Query] = []
            try:
                queries.append(self._queryable.handler.recv())
                while len(queries) < QUERIES and (more := self._queryable.handler.try_recv()):
                    queries.append(more)
            except zenoh.ZError:
                if not queries:
                    return
            self._wait_for_what_arrived()
            self._sync_for(queries)
            for query in queries:
                with query:
                    self._try_to_reply(query)

    def _sync_for(self, queries: Sequence[zenoh.Query]) -> None:
        """One sync for all who want to know whether their writes are on the disk."""
        if any(str(query.key_expr).endswith(_STAMPS) for query in queries):
            self._questions.sync()

    def _try_to_reply(self, query: zenoh.Query) -> None:
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
        if (asked := self._questions.find(rest)) is not None:
            self._answer(query, realm, *asked)
            return
        for write in self._store.select(keyexpr):
            query.reply(
                write.keyexpr,
                write.data,
                encoding=write.encoding,
                timestamp=timestamp_of_stamp(write.stamp),
                attachment=text_of_stamp(write.stamp),
            )

    def _answer(self, query: zenoh.Query, realm: str, key: Key[Any, Any], address: Address) -> None:
        keyexpr = str(query.key_expr)
        data = query.payload.to_bytes() if query.payload is not None else b"{}"
        asked = decode_value(key, Encoded(keyexpr, data, str(query.encoding or "")))
        answer = key.encode(self._questions.answer(realm, key, address, asked))
        query.reply(keyexpr, answer, encoding=reply_encoding_of(key))
