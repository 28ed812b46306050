"""Which writes a store takes in: beyond its limits it takes none, and remembers whom to tell."""

from __future__ import annotations

import logging
import time
from collections import Counter, OrderedDict
from collections.abc import Callable, Sequence
from typing import NamedTuple

from msgspec.structs import replace

from keyexpr_schema.keyspace import REVOCATIONS
from keyexpr_schema.limits import Limits, in_force, too_long, too_many, too_many_of_one
from keyexpr_schema.transport.attachments import Attachment
from keyexpr_schema.transport.heard import Heard
from keyexpr_schema.transport.samples import Encoded, too_far_ahead
from keyexpr_schema.transport.signatures import FRESH_S, Authority, objection_to_names
from keyexpr_schema.transport.stamps import same_session, source_of_stamp, text_of_stamp
from keyexpr_schema.transport.store.receipts import successor
from keyexpr_schema.transport.store.storage import Store, Write, is_by_receipt, stored_key

TOLD_S = 600.0
"""For so long after the last refusal [s] the store says that it has refused writes."""
LONGEST = 500
"""Characters of why: it quotes what somebody has put, who may have put very much."""
REMEMBERED = 10_000
"""Keys of which it is remembered why they were refused; whoever waits asks within milliseconds."""

Counts = Counter[tuple[str, str, int | None]]
"""Keys that have a value: by realm, kind, and who wrote them last, or (None) whoever did."""

_log = logging.getLogger(__name__)


class Refusal(NamedTuple):
    """A write that was not taken in: its time stamp, why, and whether it never will be."""

    timestamp: str
    why: str
    lasting: bool


class Admission:
    """Judges writes to `store` before they are applied; for one thread at a time."""

    def __init__(
        self,
        store: Store,
        limits: Limits | None = None,
        now_s: Callable[[], float] = time.time,
        stamped_s: Callable[[], float] = time.time,
        authority: Authority | None = None,
    ) -> None:
        """`now_s` is the host's clock, and `stamped_s` that by which the store itself stamps [s,
        Unix]: where the host's was set back, they differ, and nothing else goes on. With an
        `authority` nothing is taken in that somebody else has signed than it says it is from."""
        self._store, self._limits = store, limits or in_force()
        self._now_s, self._stamped_s = now_s, stamped_s
        self.authority, self._heard = authority, Heard(FRESH_S)
        self._counts: Counts | None = None
        """None: to be counted."""
        if authority is not None:
            self._learn(authority)
        self._refused: OrderedDict[str, Refusal] = OrderedDict()
        self._times = 0
        self._last: tuple[float, str] = (0.0, "")

    def _learn(self, authority: Authority) -> None:
        """Which certificates are revoked, as far as it was stored."""
        for write in self._store.select(f"*/{REVOCATIONS.pattern()}"):
            authority.judge(
                Encoded(write.keyexpr, write.data, write.encoding), write.stamp, Attachment()
            )

    # --- judging ---------------------------------------------------------------------------------

    def takes(self, keyexpr: str, stamp: int, size: int) -> bool:
        """Whether a value of `size` bytes, or a deletion, may come in at all."""
        key = stored_key(keyexpr)
        large = None if key is None else too_long(key, size, self._limits)
        why = large or too_far_ahead(stamp, self._now_s, self._stamped_s, self._limits)
        if why is not None:
            self._refuse(keyexpr, stamp, why, lasting=large is not None)
        return why is None

    def judged(self, write: Write, attachment: Attachment) -> Write | None:
        """A write with who has signed it; `None`: it is not from whom it says, or not from one who
        may delete that."""
        if self.authority is None:
            return write
        keyexpr, stamp, deleted = write.keyexpr, write.stamp, write.deleted
        by, why = "", self.authority.too_old(keyexpr, stamp, deleted=deleted)
        if why is None:
            value = Encoded(keyexpr, write.data, write.encoding)
            by, why = self.authority.judge(value, stamp, attachment, deleted=deleted)
        if why is not None:
            # Another certificate may be believed, or this one later; a name stays wrong.
            self._refuse(keyexpr, stamp, why, lasting=bool(by))
            return None
        return replace(write, by=by) if by else write

    def objection_to_asker(
        self, asker: str, asks: Encoded, attachment: Attachment, value: Encoded
    ) -> str | None:
        """Why somebody may not have the store write a value, which it signs; `None`: he may.

        `asks` is his question. Access control sees who asks, and knows no more than when its router
        was started.
        """
        if self.authority is None:
            return None
        by, why = self.authority.judge(asks, 0, attachment)
        if why is None and by != asker:
            why = f"{by} has signed what {asker} asks"
        if why is None and stored_key(value.keyexpr) is REVOCATIONS:
            why = self.authority.objection(value, 0, Attachment())
        return why or objection_to_names(asker, value)

    def admitted(self, batch: Sequence[Write]) -> list[Write]:
        """Those that there is room for; a key that has a value may always have another.

        They count as applied: `uncertain` says where they may not have been. What goes by receipt
        has been received.
        """
        self._heard.begin()
        counts = self._counted()
        found = self._store.newest([write.keyexpr for write in batch])
        newest = {known.keyexpr: known for known in found if known is not None}
        taken: list[Write] = []
        for write in batch:
            if "*" in write.keyexpr:
                if taken:
                    self._counts = None  # what it concerns is known when those are applied
                for each in self._store.select(write.keyexpr) if write.deleted else ():
                    if each.stamp < write.stamp and each.keyexpr not in newest:
                        self._count(counts, each.keyexpr, each.stamp, -1)
                        newest[each.keyexpr] = replace(write, keyexpr=each.keyexpr)
                taken.append(write)
                continue
            signed = self.authority is not None and is_by_receipt(write.keyexpr)
            if signed and self._heard.before(write.by, write.keyexpr, write.stamp):
                continue  # somebody says again what was said
            known = newest.get(write.keyexpr)
            there = known is not None and not known.deleted
            if (holds := successor(write, known)) is not None:
                if not (there or write.deleted) and (why := self._full(counts, write)) is not None:
                    self._refuse(write.keyexpr, write.stamp, why)
                    continue
                was = known.stamp if known is not None and there else None
                self._count_again(counts, write, was)
                newest[write.keyexpr] = holds
                taken.append(write)
            if signed:
                self._heard.note(write.by, write.keyexpr, write.stamp)
        return taken

    def _full(self, counts: Counts, write: Write) -> str | None:
        """Why there is no room for one more key like this, if there is none."""
        key = stored_key(write.keyexpr)
        if key is None:
            return None
        realm, most = write.keyexpr.partition("/")[0], self._limits.most_keys(key)
        if counts[realm, key.name, None] >= most:
            return too_many(key, self._limits)
        own = counts[realm, key.name, source_of_stamp(write.stamp)]
        if own >= self._limits.most_of_one(key):
            return too_many_of_one(key, own)
        return None

    def _count_again(self, counts: Counts, write: Write, was: int | None) -> None:
        """Count a write in place of the value with the stamp `was`, if there was one."""
        if was is not None and not write.deleted and same_session(was, write.stamp):
            return
        if was is not None:
            self._count(counts, write.keyexpr, was, -1)
        if not write.deleted:
            self._count(counts, write.keyexpr, write.stamp, 1)

    @staticmethod
    def _count(counts: Counts, keyexpr: str, stamp: int, more: int) -> None:
        if (key := stored_key(keyexpr)) is not None:
            for who in (None, source_of_stamp(stamp)):
                kind = (keyexpr.partition("/")[0], key.name, who)
                counts[kind] += more
                if not counts[kind]:
                    del counts[kind]

    def why_not(self, write: Write) -> str | None:
        """Why a write of somebody who waits for its answer is not taken in, if it is not."""
        if self.takes(write.keyexpr, write.stamp, len(write.data)) and self.admitted([write]):
            return None
        refused = self._refused.get(write.keyexpr)
        if refused is not None and refused.timestamp == text_of_stamp(write.stamp):
            return refused.why
        return "somebody has written it later"

    def uncertain(self) -> None:
        """What was admitted last may not have been applied."""
        self._counts = None
        self._heard.take_back()

    def _counted(self) -> Counts:
        if self._counts is None:
            self._counts = Counter()
            for write in self._store.select("**"):
                self._count(self._counts, write.keyexpr, write.stamp, 1)
        return self._counts

    # --- telling ---------------------------------------------------------------------------------

    def _refuse(self, keyexpr: str, stamp: int, why: str, *, lasting: bool = False) -> None:
        now_s = self._now_s()
        why = why if len(why) <= LONGEST else f"{why[:LONGEST]}…"
        if now_s - self._last[0] > TOLD_S:
            self._times = 0
            _log.warning("%s is not stored: %s", keyexpr, why)
        self._times += 1
        self._last = (now_s, f"{keyexpr.partition('/')[2]}, because {why}")
        self._refused.pop(keyexpr, None)
        self._refused[keyexpr] = Refusal(text_of_stamp(stamp), why, lasting)
        while len(self._refused) > REMEMBERED:
            self._refused.popitem(last=False)

    def refused(self, keyexpr: str) -> Refusal | None:
        """The write of this key that was refused last, if it was lately."""
        return self._refused.get(keyexpr)

    @property
    def refusing(self) -> str | None:
        """How many writes were refused lately, and the last of them; None: none."""
        last_s, what = self._last
        if not self._times or self._now_s() - last_s > TOLD_S:
            return None
        times = "one write" if self._times == 1 else f"{self._times} writes"
        return f"the store has not taken in {times}; the last was {what}"
