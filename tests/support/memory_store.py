"""A store's process in memory: for what is to be seen in virtual time.

What judges, applies and answers is the real store; what passes on threads there is done in turn.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

import zenoh

from fleet.errors import StoreError
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.keyspace import STORE_STAMPS
from keyexpr_schema.limits import Limits
from keyexpr_schema.transport.attachments import Attachment
from keyexpr_schema.transport.link import Replies
from keyexpr_schema.transport.samples import Encoded, Sample, decode_value, reply_encoding_of
from keyexpr_schema.transport.stamps import stamp_of_text
from keyexpr_schema.transport.store.admission import Admission
from keyexpr_schema.transport.store.intake import Intake, is_kept
from keyexpr_schema.transport.store.questions import Asked, StoreQuestions
from keyexpr_schema.transport.store.storage import Write
from keyexpr_schema.transport.store.troubles import Troubles
from tests.support.virtual_time import Clock

REALM = "home"
_NS = 1_000_000_000
Answer = Callable[[Replies], None]


class Around(Protocol):
    """The router of a store."""

    clock: Clock

    def later(self, act: Callable[[], object]) -> None:
        """Do something in a moment, unless the store is gone by then."""

    def spread(self, sender: None, sample: Sample) -> None:
        """Bring a value to all."""


class _FullAtTimes(SqliteStore):
    """A store whose disk may be full, and that knows when it has taken in what."""

    full = False

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, wall_time_s=time.time)
        self.taken: dict[tuple[str, int], float] = {}
        """When (by the loop's clock) it has taken in a write of a key last."""

    def apply(self, batch: Sequence[Write]) -> int:
        self._mind()
        changed = super().apply(batch)
        now_s = asyncio.get_running_loop().time()
        for write in batch:
            self.taken[write.keyexpr.removeprefix(f"{REALM}/"), write.stamp] = now_s
        return changed

    def sync(self) -> None:
        self._mind()
        super().sync()

    def _mind(self) -> None:
        if self.full:
            raise StoreError("the disk is full")


class HybridClock:
    """That of a session: it follows its host's, and never goes back."""

    def __init__(self, number: int, clock: Clock) -> None:
        self._source, self._clock, self._last_ns = bytes([number]) * 16, clock, 0

    def new_timestamp(self) -> zenoh.Timestamp:
        self._last_ns = max(self._clock.now_ns(), self._last_ns + 1)
        return zenoh.Timestamp(zenoh.NTP64(*divmod(self._last_ns, _NS)), self._source)


class ServedStore:
    """What a store's process does with what comes: as `StoreServer`, with its own parts."""

    def __init__(self, router: Around, folder: Path, limits: Limits) -> None:
        self._router = router
        self.store = _FullAtTimes(folder)
        self._admission = Admission(self.store, limits, time.time, time.time)
        troubles = Troubles()
        self._intake: Intake[Callable[[], None]] = Intake(self.store, self._admission, troubles)
        self._questions = StoreQuestions(
            self.store, self._write, self._admission, troubles, lambda: None
        )
        self._stamps = HybridClock(255, router.clock)

    def came(self, sample: Sample) -> None:
        """A value or a deletion has arrived."""
        keyexpr, deleted = f"{REALM}/{sample.keyexpr}", sample.deleted
        if not is_kept(keyexpr, deleted=deleted):
            return
        if not self._admission.takes(keyexpr, sample.stamp, len(sample.data)):
            return
        self._intake.put(
            keyexpr,
            sample.stamp,
            deleted=deleted,
            encoding=sample.encoding,
            data=sample.data,
            attachment=Attachment.read(sample.attached),
        )
        self._router.later(self._apply)

    def _apply(self) -> None:
        for answer in self._intake.apply_next():
            answer()
        if self._intake:
            self._router.later(self._apply)

    def _write(self, keyexpr: str, encoding: str, data: bytes, allowed: Callable[[], bool]) -> bool:
        new = self._stamps.new_timestamp
        if (timestamp := self._intake.write_if(keyexpr, encoding, data, allowed, new)) is None:
            return False
        stamp = stamp_of_text(str(timestamp))
        self._router.spread(None, Sample(keyexpr[len(REALM) + 1 :], data, encoding, stamp, False))
        return True

    def asked(self, question: Encoded, answer: Answer) -> None:
        """A query has arrived; it is answered when all is applied that came before."""
        found, asked = self._questions.find(question.keyexpr), None
        if found is not None:
            asked = Asked(REALM, *found, decode_value(found[0], question), question.data)

        def reply() -> None:
            self._router.later(lambda: answer(self._answer(question.keyexpr, asked)))

        if not self._intake.hold(reply, f"{REALM}/{question.keyexpr}", asked):
            reply()

    def _answer(self, keyexpr: str, asked: Asked | None) -> Replies:
        if asked is None:
            found = self.store.select(f"{REALM}/{keyexpr}")
            of_realm = len(REALM) + 1
            values = [
                Sample(w.keyexpr[of_realm:], w.data, w.encoding, w.stamp, False) for w in found
            ]
            return Replies(values)
        if asked.key is STORE_STAMPS:
            self._questions.sync([asked])
        try:
            data = asked.key.encode(self._questions.answer(asked))
        except SchemaError as error:
            return Replies(errors=[str(error)])
        return Replies([Sample(keyexpr, data, reply_encoding_of(asked.key), 0, False)])
