"""One watched pattern, and what is known of the keys in it."""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import takewhile
from typing import Any, Generic

import zenoh

from keyexpr_schema.errors import ForeignKey, UndecodablePayload
from keyexpr_schema.key import A, Address, Key, P
from keyexpr_schema.limits import in_force, too_many, too_many_of_one
from keyexpr_schema.transport.live_signatures import LiveSignatures
from keyexpr_schema.transport.samples import Sample, decode_value, too_far_ahead
from keyexpr_schema.transport.stamps import same_session, source_of_stamp, text_of_stamp
from keyexpr_schema.transport.undecodable import UndecodableReports
from keyexpr_schema.transport.unsaid import DOUBT_S, RELIST_S, Unsaid

TOMBSTONE_S = 60.0
"""For so long the stamp of a deletion is kept: an older put that comes late must not undo it."""


@dataclass(frozen=True)
class Change(Generic[A, P]):
    """A new value of one key; `value` None: deleted. `timestamp` is Zenoh's, as text; `received`
    orders what the store has received [µs], 0 where nobody asked it."""

    key: Key[A, P]
    address: A
    value: P | None
    timestamp: str
    received: int = 0


@dataclass(frozen=True)
class Narrowed:
    """A watched key of which only those addresses are listed whose `field` is one of `values()`.

    What changes is delivered of all of them. For keys that pile up, where whoever watches knows
    which of those that are there already can still matter.
    """

    key: Key[Any, Any]
    field: str
    values: Callable[[], Collection[str]]


class Selection:
    """What is known of the keys that match `pattern`; hands new values to `deliver`.

    It remembers the keys that exist, as far as they are listed, and those deleted a while ago.
    """

    def __init__(
        self,
        key: Key[Any, Any],
        pattern: str,
        narrowed: Narrowed | None,
        undecodable: UndecodableReports,
        deliver: Callable[[str, Change[Any, Any]], None],
        relist: Callable[..., None],
        stamped_s: Callable[[], float] = time.time,
        signatures: LiveSignatures | None = None,
    ) -> None:
        self.key, self.pattern = key, pattern
        self._matches = zenoh.KeyExpr(pattern)
        self._narrowed, self._undecodable = narrowed, undecodable
        self._deliver, self._relist, self._stamped_s = deliver, relist, stamped_s
        self._signatures = signatures
        self._stamps: dict[str, int] = {}
        """Of the keys that have a value, readable or not."""
        self._received: dict[str, int] = {}
        """Of keys that go by receipt, and have a value or were deleted a while ago, when the store
        received what it said last."""
        self._writers: Counter[int] = Counter()
        """How many keys are of whom."""
        self._with: dict[Any, set[str]] = {}
        """Of a narrowed key, those that have a value, by what they are narrowed by."""
        self._gone: dict[str, tuple[int, float]] = {}
        """Stamp of a key's deletion, and until when (by the loop's clock) it is kept: the oldest
        first."""
        self._unsaid = Unsaid()
        self._doubted: set[str] = set()
        self._doubted_generation = 0

    def __contains__(self, keyexpr: str) -> bool:
        return keyexpr in self._stamps

    def __len__(self) -> int:
        """How many keys are remembered, those that were deleted included."""
        return len(self._stamps) + len(self._gone)

    def expect(self, keyexpr: str) -> None:
        """Take a key to have a value that is older than any; what a listing lacks is deleted."""
        if self._matches.includes(keyexpr):
            self._set(keyexpr, self._stamps.get(keyexpr, 0), self.key.parse(keyexpr))

    def heard(self, sample: Sample) -> None:
        """Take in what passes on the link, which no store has judged."""
        why = too_far_ahead(sample.stamp, time.time, self._stamped_s)
        own = self._writers[source_of_stamp(sample.stamp)]
        new = not sample.deleted and sample.keyexpr not in self._stamps and self.key.stored
        if why is None and new and own >= in_force().most_of_one(self.key):
            why = too_many_of_one(self.key, own)
        by = ""
        if why is None and self._signatures is not None:
            by, why = self._signatures.judge(sample)
        if why is not None:
            self._undecodable.report(
                sample.keyexpr, sample.data, f"a write of {sample.keyexpr} is not taken in: {why}"
            )
            return
        news = self._signatures is None or self._signatures.is_news(self.key, sample, by)
        if news:
            self._hear(sample)
        elif news is None:
            self._relist()

    def _hear(self, sample: Sample) -> None:
        """Pass on what is newer, and note that the store has not said it. It may never: whose word
        is there to stay it knows alone."""
        keyexpr, known = sample.keyexpr, self._known(sample.keyexpr)
        if not self.offer(sample) or not self.key.stored:
            return
        contests = self.key.by_receipt and known is not None
        contests = contests and not same_session(sample.stamp, known or 0)
        contests = contests or self._unsaid.contests(keyexpr)
        self.doubt(keyexpr, contests=contests)
        if contests:
            self._relist(after_s=DOUBT_S)

    def offer(self, sample: Sample) -> bool:
        """Pass on what is newer than what is known of its key; whether it was."""
        keyexpr, stamp = sample.keyexpr, sample.stamp
        if "*" in keyexpr:
            # A wildcard put or delete: it concerns the keys that exist, which the store knows.
            self._relist()
            return False
        known = self._known(keyexpr)
        if known is not None and stamp and not self._is_news(stamp, known):
            return False
        return self._take(sample, stamp or known or 0)

    def _known(self, keyexpr: str) -> int | None:
        """The stamp of the last write that is known of a key."""
        known = self._stamps.get(keyexpr)
        if known is None and (gone := self._gone.get(keyexpr)) is not None:
            known = gone[0]
        return known

    def _take(self, sample: Sample, stamp: int) -> bool:
        """Pass on a value of one key; False: there can be none, or there is no room."""
        keyexpr = sample.keyexpr
        try:
            address = self.key.parse(keyexpr)
        except ForeignKey as error:
            # The pattern matches it and the store may keep it, but nobody can have an id in it.
            self._undecodable.report(keyexpr, sample.data, str(error))
            return False
        new = not sample.deleted and keyexpr not in self._stamps
        if new and self.key.stored and len(self._stamps) >= in_force().most_keys(self.key):
            why = f"{keyexpr} is not taken in: {too_many(self.key)}"
            self._undecodable.report(keyexpr, sample.data, why)
            return False
        self._remember(keyexpr, stamp, sample.deleted, address)
        try:
            value = None if sample.deleted else decode_value(self.key, sample)
        except UndecodablePayload as error:
            self._undecodable.report(keyexpr, sample.data, str(error))
            return True
        text = text_of_stamp(sample.stamp)
        self._deliver(keyexpr, Change(self.key, address, value, text, sample.received))
        return True

    def _is_news(self, stamp: int, known: int) -> bool:
        """Of keys that go by receipt stamps order what one session has put only. What is known and
        from later than now is this session's own, of when the clock of its host was ahead."""
        if self.key.by_receipt and not same_session(stamp, known):
            return True
        return stamp > known or bool(too_far_ahead(known, time.time, self._stamped_s))

    def _remember(self, keyexpr: str, stamp: int, deleted: bool, address: Address) -> None:
        self._doubted.discard(keyexpr)
        if deleted:
            self._unset(keyexpr)
            self._gone.pop(keyexpr, None)
            self._gone[keyexpr] = stamp, asyncio.get_running_loop().time() + TOMBSTONE_S
        else:
            self._gone.pop(keyexpr, None)
            self._set(keyexpr, stamp, address)

    def _set(self, keyexpr: str, stamp: int, address: Address) -> None:
        known = self._stamps.get(keyexpr)
        if known is not None:
            self._count(known, -1)
        elif self._narrowed is not None:
            value = getattr(address, self._narrowed.field)
            self._with.setdefault(value, set()).add(keyexpr)
        self._stamps[keyexpr] = stamp
        self._count(stamp, 1)

    def _unset(self, keyexpr: str) -> int:
        stamp = self._stamps.pop(keyexpr, None)
        if stamp is None:
            return 0
        self._count(stamp, -1)
        if self._narrowed is not None:
            value = self._narrowed_by(keyexpr)
            self._with[value].discard(keyexpr)
            if not self._with[value]:
                del self._with[value]
        return stamp

    def _count(self, stamp: int, more: int) -> None:
        source = source_of_stamp(stamp)
        self._writers[source] += more
        if not self._writers[source]:
            del self._writers[source]

    def _narrowed_by(self, keyexpr: str) -> Any:
        assert self._narrowed is not None
        return getattr(self.key.parse(keyexpr), self._narrowed.field)

    def is_older(self, sample: Sample, before: Mapping[str, int]) -> bool:
        """Whether a store has an older value of a key than was known `before` it was asked."""
        if self.key.by_receipt:
            return 0 < sample.received < self._received.get(sample.keyexpr, 0)
        return sample.stamp < before.get(sample.keyexpr, 0)

    def changed(self, sample: Sample) -> None:
        """Take in what the store says of a key that changed, if it is one of these; nobody waits
        for the end of a key that was never known. What is older than what it has said before it
        says because it was set back."""
        keyexpr, by_receipt = sample.keyexpr, self.key.by_receipt
        self._unsaid.said(keyexpr, sample.stamp)
        news = not sample.deleted or keyexpr in self._stamps
        if not news or not self._matches.includes(keyexpr):
            return
        older = by_receipt and sample.received < self._received.get(keyexpr, 0)
        if not older and self.offer(sample):
            if self._unsaid.drop(keyexpr) and by_receipt:
                # What it takes the place of may be on its way to the store.
                self.doubt(keyexpr, contests=True)
        elif keyexpr not in self._unsaid and self._known(keyexpr) != sample.stamp:
            self.doubt(keyexpr, RELIST_S)
        if by_receipt and not older and (keyexpr in self._stamps or keyexpr in self._gone):
            self._received[keyexpr] = sample.received

    def doubt(self, keyexpr: str, after_s: float = 0.0, *, contests: bool = False) -> None:
        """Have the store asked, after so long [s], whether it has what is known of a key."""
        if (known := self._known(keyexpr)) is not None:
            since_s = asyncio.get_running_loop().time() + after_s
            self._unsaid.passed(keyexpr, known, since_s, contests=contests)

    @property
    def contested(self) -> bool:
        """Whether something that the store has not said contradicts what somebody else said."""
        return self._unsaid.contested

    def doubtful(self, since_s: float) -> dict[str, int]:
        """What is known, by the link alone, since then or longer (by the loop's clock): the stamp
        of each key."""
        return self._unsaid.doubtful(since_s, self._known)

    def believe(self, known: Mapping[str, int], others: Mapping[str, Sample | None]) -> None:
        """Take what the store has at keys of which these stamps are `known` for what it is, if
        nothing was heard of them since: just that, but for `others`."""
        for keyexpr, stamp in known.items():
            if self._known(keyexpr) != stamp:
                continue
            self._unsaid.said(keyexpr, stamp)
            if keyexpr not in others:
                continue
            there = others[keyexpr]
            if there is None:
                self.delete({keyexpr})
            elif there.stamp != stamp and self._take(there, there.stamp) and self.key.by_receipt:
                self._received[keyexpr] = there.received

    def trust(self) -> None:
        """What is known stands, whatever a store has or has not."""
        self._unsaid.clear()

    def patterns(self) -> Iterator[str]:
        """What has to be listed now."""
        if self._narrowed is None:
            yield self.pattern
            return
        for value in self._narrowed.values():
            yield self.key.pattern(**{self._narrowed.field: value})

    def forget(self) -> None:
        """Let go of what nobody asks for any more: old deletions, and keys no longer listed."""
        now_s = asyncio.get_running_loop().time()
        old = takewhile(lambda each: each[1][1] <= now_s, self._gone.items())
        for keyexpr in [keyexpr for keyexpr, _ in old if keyexpr not in self._unsaid]:
            del self._gone[keyexpr]
            if keyexpr not in self._stamps:
                self._received.pop(keyexpr, None)
        if self._narrowed is not None:
            for value in self._with.keys() - set(self._narrowed.values()):
                for keyexpr in tuple(self._with[value]):
                    self._unset(keyexpr)
                    self._received.pop(keyexpr, None)

    def known(self) -> dict[str, int]:
        """The keys that are known to have a value, and its stamp."""
        return dict(self._stamps)

    def missing(self, known: dict[str, int], listed: set[str]) -> set[str]:
        """Of what was `known` before a listing, and was not heard of since, what it lacks."""
        return {
            keyexpr
            for keyexpr, stamp in known.items()
            if keyexpr not in listed and self._stamps.get(keyexpr) == stamp
        }

    def missing_twice(self, missing: set[str], generation: int) -> set[str]:
        """What was missing in the last listing, too, both times in one generation of the link."""
        again = self._doubted & missing if self._doubted_generation == generation else set()
        self._doubted, self._doubted_generation = missing, generation
        return again

    def delete(self, keyexprs: set[str]) -> None:
        """Take keys for deleted whose deletion nobody saw; a listing that has them brings them
        back."""
        self._doubted -= keyexprs
        for keyexpr in sorted(keyexprs & self._stamps.keys()):
            stamp = text_of_stamp(self._unset(keyexpr))
            self._received.pop(keyexpr, None)
            self._deliver(keyexpr, Change(self.key, self.key.parse(keyexpr), None, stamp))
