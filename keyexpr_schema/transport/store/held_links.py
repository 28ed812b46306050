"""Who floods a store is slowed down at the link by which he comes.

The store tells of what has come to it. Once somebody goes too fast, links are listened to, until
nobody has had to wait for a while: a call for each value costs everybody a fifth of his writes.
Zenoh calls a subscriber in the task that reads the link on which the value came: as long as the
call lasts that link is not read, and no other waits for it. What else he sends stays at his end, by
TCP's own flow control; nothing is lost, and nothing comes out of its order.

Held is only who is linked to this router himself: what somebody behind another router has written
comes by a link that others use, too. Where no other router is there, who is not known has forged
his stamps, or has begun them anew (`session_stamps`), or has come or gone this moment.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import zenoh
from zenoh import handlers

from keyexpr_schema.key import Delivery
from keyexpr_schema.keyspace import KEYSPACE
from keyexpr_schema.limits import in_force
from keyexpr_schema.payloads.system import StoreStampsQuery
from keyexpr_schema.transport.receiving import most_held
from keyexpr_schema.transport.stamps import source_of_stamp, stamp_of_text, text_of_stamp
from keyexpr_schema.transport.store.pacing import Pacing, cost
from keyexpr_schema.transport.store.storage import stored_key

TOLD_S = 600.0
"""For so long after a link was held last [s] the store says so."""
LISTENS_S = 10.0
"""For so long after a link was held last [s] what comes is listened to at the links."""
UNKNOWN = "?"
"""Whose stamps nobody knows; they share what one has."""

_log = logging.getLogger(__name__)


_PACED = tuple(key for key in KEYSPACE if key.stored and not key.of_processes)
"""What people or robots write, and the store keeps."""
_LATEST = {key.name: key.delivery is Delivery.LATEST for key in _PACED}
"""Of each of these whether only the latest matters."""


class _Slowed:
    """Who was slowed down lately, and by how much; for one thread at a time."""

    def __init__(self) -> None:
        self._held_s = 0.0
        self._last_s, self._last_keyexpr = -TOLD_S, ""
        self._writers: set[str] = set()

    def note(self, writer: str, keyexpr: str, wait_s: float, now_s: float) -> bool:
        """That `writer` waits for `wait_s` with this, from `now_s` on; whether he is the first to,
        or has not had to for long."""
        if now_s - self._last_s > TOLD_S:
            self._held_s = 0.0
            self._writers.clear()
        fresh = writer not in self._writers
        self._writers.add(writer)
        self._held_s += wait_s
        self._last_s, self._last_keyexpr = now_s, keyexpr
        return fresh

    def told(self, now_s: float) -> str | None:
        """The sentence that the store says of it; None: nobody was."""
        if now_s - self._last_s > TOLD_S:
            return None
        many = len(self._writers)
        who = "one writer" if many == 1 else f"{many} writers"
        return (
            f"the store has slowed down {who}, by {self._held_s:.3g} s in all: too much came that "
            f"nobody waits to have confirmed; the last was {self._last_keyexpr.partition('/')[2]}"
        )


class HeldLinks:
    """Holds the links of who goes too fast with what is paced on a router's session.

    `now_s` is a clock that nobody sets [s].
    """

    def __init__(self, session: zenoh.Session, now_s: Callable[[], float] = time.monotonic) -> None:
        limits = in_force()
        self._pacing = Pacing(limits.unconfirmed, limits.unconfirmed_per_s)
        self._now_s = now_s
        self._lock = threading.Lock()
        self._free = threading.Semaphore(most_held())
        self._ended = threading.Event()
        self._near = {_id(str(session.info.zid()))}  # whose stamp is on what had none
        self._routers: set[str] = set()
        self._slowed = _Slowed()
        self._session = session
        self._declaring = threading.Lock()
        self._listening: list[zenoh.Subscriber[None]] = []
        self._listens_until_s = 0.0
        self._transports: Any = session.info.declare_transport_events_listener(
            handlers.Callback(self._on_transport, indirect=False), history=True
        )

    @property
    def routers(self) -> int:
        """How many other routers are connected: who writes behind them nobody here can hold."""
        return len(self._routers)

    def close(self) -> None:
        """Hold nobody any more."""
        if self._ended.is_set():
            return
        self._ended.set()
        self._listen_no_more()
        self._transports.undeclare()

    def came(self, keyexpr: str, stamp: int, size: int) -> None:
        """A value of `size` bytes has come to the store, which says so of all, from one thread:
        what it does not take in others hear, too."""
        if self._listening:
            if self._now_s() > self._listens_until_s:
                self._listen_no_more()
            return
        counted = _counted(keyexpr, size)
        if counted is not None and self._spend(stamp, counted)[1]:
            self._listen()

    def _listen(self) -> None:
        with self._declaring:
            if self._ended.is_set():
                return
            self._listens_until_s = self._now_s() + LISTENS_S
            self._listening = [
                self._session.declare_subscriber(
                    f"*/{key.pattern()}",
                    handlers.Callback(partial(self._passes, _LATEST[key.name]), indirect=False),
                )
                for key in _PACED
            ]

    def _listen_no_more(self) -> None:
        with self._declaring:
            gone, self._listening = self._listening, []
            for each in gone:
                each.undeclare()  # type: ignore[no-untyped-call]

    def _spend(self, stamp: int, spent: float) -> tuple[str, float]:
        """Who pays for what has this stamp and counts for `spent`, and for how long he has to wait
        [s]."""
        with self._lock:
            payer = self._payer(stamp)
            if payer is None:
                return UNKNOWN, 0.0
            return payer, self._pacing.spend(payer, stamp, spent, self._now_s())

    def _payer(self, stamp: int) -> str | None:
        """Who pays for what has this stamp, for whoever holds the lock; None: nobody."""
        writer = _writer(source_of_stamp(stamp))
        if writer in self._near:
            return writer
        return None if self._routers else UNKNOWN

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        opened = event.kind == zenoh.SampleKind.PUT
        router = event.transport.whatami == zenoh.WhatAmI.ROUTER
        who = _id(str(event.transport.zid))
        with self._lock:
            known = self._routers if router else self._near
            (known.add if opened else known.discard)(who)
            if not opened:
                self._pacing.forget(who)

    def _passes(self, latest: bool, sample: zenoh.Sample) -> None:
        keyexpr = str(sample.key_expr)
        if "*" in keyexpr or not self._listening:  # Zenoh declares nothing more while it calls
            return
        stamp = stamp_of_text(str(sample.timestamp))
        writer, wait_s = self._spend(stamp, cost(len(sample.payload), latest))
        if wait_s and self._free.acquire(blocking=False):
            try:
                self._note(keyexpr, writer, wait_s)
                self._ended.wait(wait_s)
            finally:
                self._free.release()

    def answers(self, asked: StoreStampsQuery) -> None:
        """Somebody is told what became of the writes that he waits for: taken in, refused or
        overtaken. Who asks of keys alone waits for nobody's."""
        try:
            writes = [stamp_of_text(f"{ticks}/{asked.source}") for ticks in asked.waits]
        except ValueError:
            return  # nobody of ours says such
        if writes:
            with self._lock:
                if (payer := self._payer(writes[0])) is not None:
                    self._pacing.answered(payer, writes)

    def _note(self, keyexpr: str, writer: str, wait_s: float) -> None:
        with self._lock:
            now_s = self._now_s()
            fresh = self._slowed.note(writer, keyexpr, wait_s, now_s)
            self._listens_until_s = now_s + LISTENS_S
        if fresh:
            _log.warning(
                "session %s writes %s and more without waiting to be confirmed, faster than is "
                "taken in: it is slowed down",
                writer,
                keyexpr,
            )

    @property
    def slowing(self) -> str | None:
        """How many writers were slowed down lately, and by how much; None: none."""
        with self._lock:
            return self._slowed.told(self._now_s())


def _counted(keyexpr: str, size: int) -> float | None:
    """What a write counts for; None: it is not paced."""
    key = stored_key(keyexpr)
    latest = None if key is None else _LATEST.get(key.name)
    return None if latest is None else cost(size, latest)


@lru_cache(maxsize=4096)
def _writer(source: int) -> str:
    """The id of the session whose stamps have this source."""
    return _id(text_of_stamp(source).rpartition("/")[2])


def _id(text: str) -> str:
    """A session's id, of which Zenoh leaves leading zeros out here and not there."""
    return text.lstrip("0")
