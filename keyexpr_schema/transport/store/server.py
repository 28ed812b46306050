"""The store behind a router: takes in what is put, and answers from a `Store`.

Four threads. One takes what has arrived out of Zenoh's channel into a queue for each writer, and
applies what waits there in small batches, writers in turn (`write_queues`). One takes queries in,
and sends a mark behind each through the channel of the values: when the first has come to it, all
that arrived before the query waits in the queues. The query is held there until what it asks about
is applied, and nothing else; then the third thread answers it, or the fourth, if it waits for the
disk: who wants to know what has changed waits for no disk. So a client reads its own writes,
and waits for nobody who writes other keys. When the queues are full nothing is taken out of the
channel, and then it is Zenoh that has the links wait that bring more. So it is with queries.

Replies carry the exact stored stamp as text in their attachment, because Python cannot rebuild a
`zenoh.Timestamp` exactly.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import uuid
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from queue import Empty, SimpleQueue
from sys import intern
from typing import NamedTuple

import zenoh
from zenoh import handlers

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.keyspace import STORE_REPLACE, STORE_STAMPS
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
from keyexpr_schema.transport.store.held_links import HeldLinks
from keyexpr_schema.transport.store.intake import Intake, is_kept
from keyexpr_schema.transport.store.questions import Asked, StoreQuestions
from keyexpr_schema.transport.store.storage import Store
from keyexpr_schema.transport.store.troubles import Troubles
from keyexpr_schema.transport.trace import Trace

_log = logging.getLogger(__name__)
CHANNEL = 1_000
"""Values, and queries, that have arrived and that nobody has looked at. Whoever writes waits for
all that are ahead."""
QUERIES = 64
"""Queries of one mark, and those that are answered after one sync, at most."""
MOST_OPEN = 1_000
"""Queries that are taken out of the channel and not answered yet, at most."""


class _Query(NamedTuple):
    """A query, what was asked, if it is one of the questions; or why it is not understood."""

    query: zenoh.Query
    asked: Asked | None
    refusal: str | None


class StoreServer:
    """Subscribes for a `Store` and replies to queries from it, on threads of its own.

    `on_broken` is called, on one of them, if that has met a fault that nobody has thought of: it
    goes on, so that this can be closed, but may have lost what it was about.
    """

    def __init__(
        self,
        session: zenoh.Session,
        store: Store,
        credentials: Credentials | None = None,
        on_broken: Callable[[BaseException], None] = lambda _: None,
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
        self._held = HeldLinks(session)
        troubles = Troubles()
        self._intake: Intake[_Query] = Intake(store, self._admission, troubles)
        self._questions = StoreQuestions(
            store, self._write, self._admission, troubles, lambda: self._held.slowing
        )
        self._ready: SimpleQueue[_Query | None] = SimpleQueue()
        self._confirms: SimpleQueue[_Query | None] = SimpleQueue()
        """Those that are answered after a sync."""
        self._mark = f"mark-{uuid.uuid4().hex}"
        self._marks = 0
        self._marked: dict[int, list[_Query]] = {}
        """Queries behind which a mark is on its way, by its number."""
        self._open = threading.Semaphore(MOST_OPEN)
        self._wide = 0
        self._subscriber = session.declare_subscriber("**", handlers.FifoChannel(CHANNEL))
        # Not complete: a complete queryable on `**` would take queries away from those that
        # serve a key.
        self._queryable = session.declare_queryable("**", handlers.FifoChannel(CHANNEL))
        # What has arrived stays there when they are undeclared, which lets nobody near them.
        self._values, self._queries = self._subscriber.handler, self._queryable.handler
        trace = Trace("store")
        for key in self._questions.keys:
            trace.note("serve", key, key.pattern())
        self._on_broken = on_broken
        self._writing = threading.Thread(target=self._write_for_ever, name="store-write")
        self._listening = threading.Thread(target=self._listen_for_ever, name="store-listen")
        self._answering = tuple(
            threading.Thread(target=self._reply_for_ever, args=(queue,), name=name)
            for name, queue in (("store-answer", self._ready), ("store-confirm", self._confirms))
        )
        for thread in (self._writing, self._listening, *self._answering):
            thread.start()

    @contextlib.contextmanager
    def _going_on(self) -> Iterator[None]:
        """Whatever happens in the block, the thread goes on."""
        try:
            yield
        except BaseException as error:  # where Zenoh panics it is no Exception
            _log.exception("a fault in the store")
            self._on_broken(error)

    def close(self) -> None:
        """Apply what arrived and answer what was asked, then end the threads."""
        self._held.close()
        self._queryable.undeclare()  # type: ignore[no-untyped-call]
        self._open.release(MOST_OPEN)  # what a fault has lost is answered no more
        self._listening.join()
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]
        self._writing.join()
        for query in chain(*self._marked.values()):
            self._answer_soon(query)
        for queue, thread in zip((self._ready, self._confirms), self._answering, strict=True):
            queue.put(None)
            thread.join()

    # --- writing ---------------------------------------------------------------------------------

    def _write_for_ever(self) -> None:
        stuck = False  # by a fault that took nothing away, and would come again and again
        while True:
            came = []
            if stuck or not self._intake:
                try:
                    came = [self._values.recv()]
                except zenoh.ZError:
                    return
            waiting, stuck = len(self._intake), True
            with self._going_on():
                self._write_some(came)
                stuck = False
            stuck = stuck and len(self._intake) >= waiting

    def _write_some(self, came: Iterable[zenoh.Sample]) -> None:
        """Take in what `came`, and whatever waits besides, and apply some of it."""
        for sample in chain(came, self._more(CHANNEL)):
            self._take_in(sample)
        for query in self._intake.apply_next():
            self._answer_soon(query)

    def _more(self, most: int) -> Iterator[zenoh.Sample]:
        """What waits in the channel, as long as there is room for it."""
        with contextlib.suppress(zenoh.ZError):
            for _ in range(most):
                if self._intake.full or (sample := self._values.try_recv()) is None:
                    return
                yield sample

    def _take_in(self, sample: zenoh.Sample) -> None:
        try:
            self._collect(sample)
        except Exception:
            _log.exception("the store could not take in what is at %s", sample.key_expr)

    def _collect(self, sample: zenoh.Sample) -> None:
        """Have `sample` wait if it is to be stored; if it is a mark, the queries before it."""
        keyexpr = str(sample.key_expr)
        deleted = sample.kind == zenoh.SampleKind.DELETE
        if not is_kept(keyexpr, deleted=deleted):
            if keyexpr == self._mark:
                self._hold(self._marked.pop(int(sample.payload.to_string())))
            elif "*" in keyexpr:
                self._refuse_wildcards(keyexpr)
            return
        timestamp = sample.timestamp or self._session.new_timestamp()
        stamp = stamp_of_text(str(timestamp))
        self._held.came(keyexpr, stamp, size := len(sample.payload))
        if not self._admission.takes(keyexpr, stamp, size):
            return
        self._intake.put(
            keyexpr,
            stamp,
            deleted=deleted,
            encoding=intern(str(sample.encoding)),  # there are a few
            data=sample.payload.to_bytes(),
            attachment=Attachment.read(attached_to(sample)),
        )

    def _hold(self, queries: Sequence[_Query]) -> None:
        """Have queries answered as soon as all is applied that came before, and concerns them."""
        for each in queries:
            try:
                waits = self._intake.hold(each, str(each.query.key_expr), each.asked)
            except Exception as error:
                _log.exception("the query for %s failed", each.query.key_expr)
                each, waits = _Query(each.query, None, f"the store failed: {error}"), False
            if not waits:
                self._answer_soon(each)

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
            ClockBehind, SchemaError, StoreFull: as `Intake.write_if`.
        """
        timestamp = self._intake.write_if(
            keyexpr, encoding, data, allowed, self._session.new_timestamp
        )
        if timestamp is None:
            return False
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

    def _listen_for_ever(self) -> None:
        while queries := self._arrived():
            with self._going_on():
                self._marks += 1
                self._marked[self._marks] = [self._understood(query) for query in queries]
                self._session.put(
                    self._mark, str(self._marks), allowed_destination=zenoh.Locality.SESSION_LOCAL
                )

    def _arrived(self) -> list[zenoh.Query]:
        """The next queries, as soon as some have come and may be open; none: no more can come."""
        queries: list[zenoh.Query] = []
        with contextlib.suppress(zenoh.ZError):
            self._open.acquire()
            queries.append(self._queries.recv())
            while len(queries) < QUERIES and self._open.acquire(blocking=False):
                if (more := self._queries.try_recv()) is None:
                    self._open.release()
                    break
                queries.append(more)
        return queries

    def _understood(self, query: zenoh.Query) -> _Query:
        keyexpr = str(query.key_expr)
        realm, _, rest = keyexpr.partition("/")
        if (question := self._questions.find(rest)) is None:
            return _Query(query, None, None)
        key, address = question
        data = query.payload.to_bytes() if query.payload is not None else b"{}"
        try:
            payload = decode_value(key, Encoded(keyexpr, data, str(query.encoding or "")))
        except SchemaError as error:
            return _Query(query, None, str(error))
        except Exception as error:
            _log.exception("the query for %s failed", keyexpr)
            return _Query(query, None, f"the store failed: {error}")
        attached = b"" if query.attachment is None else query.attachment.to_bytes()
        return _Query(query, Asked(realm, key, address, payload, data, attached), None)

    def _answer_soon(self, each: _Query) -> None:
        confirms = each.asked is not None and each.asked.key in (STORE_STAMPS, STORE_REPLACE)
        (self._confirms if confirms else self._ready).put(each)

    def _reply_for_ever(self, ready: SimpleQueue[_Query | None]) -> None:
        more = True
        while more:
            found = [ready.get()]
            with contextlib.suppress(Empty):
                while len(found) < QUERIES:
                    found.append(ready.get_nowait())
            queries = [each for each in found if each is not None]
            more = len(queries) == len(found)
            with self._going_on():
                self._sync_for(queries)
            for each in queries:
                with self._going_on(), each.query:
                    self._try_to_reply(each)
                self._open.release()

    def _sync_for(self, queries: Sequence[_Query]) -> None:
        """One sync for all who want to know whether their writes are on the disk."""
        asked = [each.asked for each in queries if each.asked is not None]
        if asking := [each for each in asked if each.key is STORE_STAMPS]:
            self._questions.sync(asking)
            for each in asking:
                self._held.answers(each.payload)  # type: ignore[arg-type]

    def _try_to_reply(self, each: _Query) -> None:
        query = each.query
        try:
            self._reply(each)
        except zenoh.ZError:
            _log.warning("a reply for %s could not be sent", query.key_expr)
        except SchemaError as error:
            with contextlib.suppress(zenoh.ZError):
                query.reply_err(str(error).encode())
        except Exception as error:
            _log.exception("the query for %s failed", query.key_expr)
            with contextlib.suppress(zenoh.ZError):
                query.reply_err(f"the store failed: {error}".encode())

    def _reply(self, each: _Query) -> None:
        query, asked, refusal = each
        if refusal is not None:
            raise SchemaError(refusal)
        if asked is not None:
            answer = asked.key.encode(self._questions.answer(asked))
            query.reply(str(query.key_expr), answer, encoding=reply_encoding_of(asked.key))
            return
        for write in self._store.select(str(query.key_expr)):
            query.reply(
                write.keyexpr,
                write.data,
                encoding=write.encoding,
                timestamp=timestamp_of_stamp(write.stamp),
                attachment=text_of_stamp(write.stamp),
            )
