"""What a store does with what comes to it: values wait, are judged and applied, and the questions
about them are held until then. No Zenoh here but its timestamps, and no thread."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

import zenoh

from keyexpr_schema.errors import SchemaError, StoreFull
from keyexpr_schema.transport.attachments import Attachment
from keyexpr_schema.transport.stamps import stamp_of_text
from keyexpr_schema.transport.store.admission import Admission
from keyexpr_schema.transport.store.questions import Asked, ClockBehind
from keyexpr_schema.transport.store.storage import (
    Store,
    Write,
    deletes_tree,
    is_by_receipt,
    is_stored,
)
from keyexpr_schema.transport.store.troubles import Troubles
from keyexpr_schema.transport.store.write_queues import WriteQueues

Q = TypeVar("Q")
_log = logging.getLogger(__name__)


def is_kept(keyexpr: str, *, deleted: bool) -> bool:
    """Whether a put, or a deletion, of this, realm included, concerns a store."""
    return is_stored(keyexpr) or (deleted and deletes_tree(keyexpr))


class Intake(Generic[Q]):
    """Takes in writes for `store`, and holds the questions `Q` that concern them.

    For one thread, which takes in and applies; `write_if` is for any.
    """

    def __init__(self, store: Store, admission: Admission, troubles: Troubles) -> None:
        self._store, self._admission, self._troubles = store, admission, troubles
        self._applying = threading.Lock()
        self._queues: WriteQueues[Q] = WriteQueues()

    def __len__(self) -> int:
        """How many writes wait to be applied."""
        return len(self._queues)

    @property
    def full(self) -> bool:
        """Whether nothing more should come before something was applied."""
        return self._queues.full

    def put(
        self,
        keyexpr: str,
        stamp: int,
        *,
        deleted: bool,
        encoding: str,
        data: bytes,
        attachment: Attachment,
    ) -> None:
        """Have a write wait for its turn, with what came beside it; `Admission.takes` was asked."""
        late_us, received = attachment.late_us or 0, self._receipt(keyexpr)
        write = Write(keyexpr, stamp, deleted, encoding, data, late_us, received)
        self._queues.put(write, attachment)

    def _receipt(self, keyexpr: str) -> int:
        """That of a write that comes now; 0 where none is needed."""
        return self._store.receipt() if is_by_receipt(keyexpr) else 0

    def hold(self, question: Q, keyexpr: str, asked: Asked | None) -> bool:
        """Have a question wait until what came before is applied, as far as it concerns that;
        whether something is waited for.

        `keyexpr` is what it is asked of, realm included; `asked`: one that is not for values alone.
        """
        if asked is not None:
            asked.received = self._store.receipt()
            return self._queues.hold(question, *asked.concerns())
        keys, patterns = ([], [keyexpr]) if "*" in keyexpr else ([keyexpr], [])
        return self._queues.hold(question, keys, patterns)

    def apply_next(self) -> list[Q]:
        """Apply some of what waits, in one transaction; the questions that wait for nothing now.

        What cannot be applied is not confirmed: its writers try again, and hear why.
        """
        if batch := self._queues.take(judge=self._judged):
            self._apply(batch)
        return self._queues.applied()

    def _apply(self, batch: list[Write]) -> None:
        try:
            with self._applying, contextlib.suppress(StoreFull):
                if admitted := self._admission.admitted(batch):
                    self._apply_or_say(admitted)
        except Exception:
            _log.exception("the store could not judge %d writes", len(batch))
            self._admission.uncertain()

    def _judged(self, write: Write, attachment: Attachment) -> Write | None:
        try:
            return self._admission.judged(write, attachment)
        except Exception:
            _log.exception("the store could not judge what is at %s", write.keyexpr)
            return None

    def _apply_or_say(self, batch: list[Write]) -> None:
        """Apply `batch`, for whoever holds the lock.

        Raises:
            StoreFull: nothing of it could be; the log and the store's answers say so.
        """
        try:
            self._store.apply(batch)
        except Exception as error:
            self._admission.uncertain()
            self._troubles.fails(error)
            raise StoreFull(str(error)) from error
        self._troubles.works()

    def write_if(
        self,
        keyexpr: str,
        encoding: str,
        data: bytes,
        allowed: Callable[[], bool],
        new_timestamp: Callable[[], zenoh.Timestamp],
    ) -> zenoh.Timestamp | None:
        """Write a key, if that is `allowed` when nothing else is written; its time stamp, or None.

        Raises:
            ClockBehind: whoever wrote it last had a clock ahead of ours.
            SchemaError: the store does not take it in.
            StoreFull: it could not write it.
        """
        with self._applying:
            if not allowed():
                return None
            newest = self._store.newest([keyexpr])[0]
            timestamp = new_timestamp()
            stamp = stamp_of_text(str(timestamp))
            late = newest is not None and newest.stamp >= stamp
            if newest is not None and late and not is_by_receipt(keyexpr):
                raise ClockBehind(newest.stamp, stamp)
            write = Write(keyexpr, stamp, False, encoding, data, 0, self._receipt(keyexpr))
            if (why := self._admission.why_not(write)) is not None:
                raise SchemaError(why)
            self._apply_or_say([write])
        return timestamp
