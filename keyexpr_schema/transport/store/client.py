"""Reading from whatever keeps the values, and confirming what was written to it.

What holds on any Zenoh storage, the embedded one or zenohd's:

* A put while the router is away is lost without an error, so what must last is read back.
* Empty is not absent: an empty listing is believed only when the store proved to be there after
  the link came up (it answers for its journal), or, with a zenohd storage that has no journal,
  when the link has been up for `SETTLE_S` and somebody answers for stored keys.
"""

from __future__ import annotations

import asyncio
import time
import uuid
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from msgspec.structs import replace

from keyexpr_schema.errors import Overtaken, StoreFull, Unconfirmed, Unreachable
from keyexpr_schema.key import Key, P
from keyexpr_schema.keyspace import (
    GOAL_SPEC,
    STORE_CHANGES,
    STORE_CLOCK,
    STORE_JOURNAL,
    STORE_REPLACE,
    STORE_STAMPS,
)
from keyexpr_schema.payloads.system import (
    StoreAddress,
    StoreAskerAddress,
    StoreChanges,
    StoreChangesQuery,
    StoreClock,
    StoreClockQuery,
    StoreQuery,
    StoreReplaced,
    StoreReplaceQuery,
    StoreStamps,
    StoreStampsQuery,
)
from keyexpr_schema.principals import Principal
from keyexpr_schema.transport.link import Link, Put, Replies
from keyexpr_schema.transport.samples import Sample, decode_reply, encoding_of
from keyexpr_schema.transport.stamps import stamp_of_text, text_of_stamp
from keyexpr_schema.transport.store.answers import Page, Replaced, replaced_sample
from keyexpr_schema.transport.store.writes import ANSWER_S, ConfirmedWrites, question_about
from keyexpr_schema.transport.trace import Trace

SETTLE_S = 0.5
PRESENT_S = 0.1
"""So soon a link knows of a store that is there [s]."""
_KEPT = GOAL_SPEC.pattern()
"""For these only somebody who keeps values answers."""
PAGE = 1000
"""Values asked for at once: some milliseconds of the store's time, in which all others wait."""


class StoreClient:
    """The store behind a link; `endpoints` are named in errors.

    `asker` is who asks it: a principal by its certificate, or else a component's name.
    """

    def __init__(
        self, link: Link, endpoints: tuple[str, ...], trace: Trace, asker: Principal | str
    ) -> None:
        self._link, self._endpoints, self._trace = link, endpoints, trace
        self._certified = isinstance(asker, Principal)
        self._asker = asker.name if isinstance(asker, Principal) else asker
        self._answered = False
        """Whether the store answered when it was last asked for stamps."""
        self._writes = ConfirmedWrites(link, self._newest, self._settled)
        self._said = StoreStamps(timestamps=())
        """What the store answered last, of itself as well."""

    async def write(
        self,
        key: Key[Any, Any],
        keyexpr: str,
        data: bytes | None,
        timeout_s: float,
        age_s: float = 0.0,
    ) -> None:
        """Put (`data` None: delete), and return when the store has exactly this write, which was
        said `age_s` ago.

        Raises:
            Overtaken: somebody else's write of the same key has a later stamp, or, where that
                goes by receipt, was received since.
            WriteRefused: it is beyond a limit of the store.
            Unconfirmed: it was not confirmed within `timeout_s`; it may still arrive.
        """
        said_s = time.monotonic() - age_s if key.by_receipt else None
        put = Put(keyexpr, data, encoding_of(key), self._link.new_timestamp(), said_s)
        try:
            async with asyncio.timeout(timeout_s):
                await self._writes.confirmed(put)
        except TimeoutError:
            raise self._unconfirmed(
                f"{'deleting ' if data is None else ''}{keyexpr}", timeout_s
            ) from None

    async def delete_matching(self, key: Key[Any, Any], pattern: str, timeout_s: float) -> None:
        """Delete what a pattern matches, and return when the store has no older value of it.

        Raises:
            Unconfirmed: it had after `timeout_s`.
            Unreachable: no store could be asked.
        """
        put = Put(pattern, None, encoding_of(key), self._link.new_timestamp())
        ours = stamp_of_text(str(put.timestamp))
        try:
            async with asyncio.timeout(timeout_s):
                while any(s.stamp < ours for s in await self.list(pattern, timeout_s)):
                    await self._link.send(put)
        except TimeoutError:
            raise self._unconfirmed(f"deleting {pattern}", timeout_s) from None

    def _unconfirmed(self, what: str, timeout_s: float) -> Unconfirmed:
        what = f"{what} was not confirmed by the store within {timeout_s:g} s"
        if not self._link.router.up:
            why = f"no router answers at {', '.join(self._endpoints)}"
        elif self._said.failing is not None:
            return StoreFull.because(what, self._said.failing)
        elif self._certified and self._answered:
            why = (
                "it answers, and has not got it; the router's access control may keep "
                f"{self._asker} from that"
            )
        else:
            why = "a router is there, but no store answers for this key"
        return Unconfirmed(f"{what}: {why}")

    async def replace(
        self, key: Key[Any, Any], keyexpr: str, data: bytes, seen: Sample | None, timeout_s: float
    ) -> Replaced:
        """Put if the key still holds what was `seen` there (None: nothing); else what it holds.

        The store compares and sets, and stamps the value. A zenohd storage cannot: there the key is
        looked at, put and read back, so that of two who do so in the same moment both may believe
        for some milliseconds that they were first.

        Raises:
            Unconfirmed: it was not known within `timeout_s`; it may have been written.
            StoreFull: it was not written, or is not on the disk after `timeout_s`.
        """
        expected = text_of_stamp(seen.stamp) if seen is not None else ""
        asked = StoreReplaceQuery(
            keyexpr=keyexpr,
            value=data.decode(),
            encoding=encoding_of(key),
            expected=expected,
            request=uuid.uuid4().hex,
        )
        router = self._link.router
        unanswered = generation = 0
        lost = False
        try:
            async with asyncio.timeout(timeout_s):
                while True:
                    await router.wait_up()
                    unanswered = unanswered + 1 if generation == router.generation else 1
                    generation = router.generation
                    replies = await self._ask(STORE_REPLACE, asked, ANSWER_S)
                    if replies.values:
                        answer: StoreReplaced = decode_reply(STORE_REPLACE, replies.values[0])  # type: ignore[assignment]
                        self._said = replace(self._said, failing=answer.failing)
                        if answer.failing is not None and not answer.done:
                            raise StoreFull.because(f"{keyexpr} was not written", answer.failing)
                        if answer.failing is not None or 0 < answer.behind_s <= timeout_s:
                            await asyncio.sleep(answer.behind_s)
                            continue
                        if answer.behind_s:
                            raise Unconfirmed(
                                f"{keyexpr} was not written: it was last written by a clock that "
                                f"is {answer.behind_s:.3g} s ahead of the router's; set the clocks"
                            )
                        there = replaced_sample(keyexpr, answer)
                        # An answer that was lost with its store may have been a yes.
                        ours = answer.done or (lost and there is not None and there.data == data)
                        return Replaced(ours, there)
                    if replies.errors:
                        raise Unconfirmed(f"{keyexpr} was not written: {replies.errors[0]}")
                    if unanswered > 1 and not replies.timed_out and router.age_s >= SETTLE_S:
                        by_hand = await self._replace_by_hand(key, keyexpr, data, expected)
                        if by_hand is not None:
                            return by_hand
                        unanswered = 0
                    lost = True
                    await asyncio.sleep(0.05)
        except TimeoutError:
            raise self._unconfirmed(keyexpr, timeout_s) from None

    async def _replace_by_hand(
        self, key: Key[Any, Any], keyexpr: str, data: bytes, expected: str
    ) -> Replaced | None:
        """None: a store of ours is there again, behind another router, which compares itself."""
        there = next(iter(await self._settled(keyexpr, ANSWER_S)), None)
        if await self.answers(ANSWER_S):
            return None
        if (text_of_stamp(there.stamp) if there is not None else "") != expected:
            return Replaced(False, there)
        put = Put(keyexpr, data, encoding_of(key), self._link.new_timestamp())
        try:
            await self._writes.confirmed(put)
        except Overtaken:
            return Replaced(False, next(iter(await self._settled(keyexpr, ANSWER_S)), None))
        stamp = stamp_of_text(str(put.timestamp))
        return Replaced(True, Sample(keyexpr, data, put.encoding, stamp, False))

    async def list(self, pattern: str, timeout_s: float) -> tuple[Sample, ...]:
        """The newest stored value of every key that `pattern` matches, undecoded.

        `timeout_s` holds for each page of a long listing, not for the whole of it.

        Raises:
            Unreachable: no router and store could be asked within `timeout_s`.
        """
        try:
            await self._link.router.wait_up(timeout_s)
            if "*" in pattern and (paged := await self._paged([pattern], timeout_s)) is not None:
                return paged
            async with asyncio.timeout(timeout_s):
                return await self._settled(pattern, timeout_s)
        except TimeoutError:
            if not self._link.router.up:
                raise Unreachable.no_router(self._endpoints, timeout_s) from None
            if not await self.present(PRESENT_S):
                raise Unreachable.no_store(self._endpoints) from None
            raise Unreachable(
                f"the store did not answer for {pattern!r} within {timeout_s:g} s"
            ) from None

    async def _paged(self, patterns: Sequence[str], timeout_s: float) -> tuple[Sample, ...] | None:
        """The values that match, page by page; None: whoever stores them does not know pages."""
        found: dict[str, Sample] = {}
        position = ""
        while (page := await self.changes(patterns, position, timeout_s)) is not None:
            if page.whole:
                found.clear()
            for sample in page.samples:
                if sample.deleted:
                    found.pop(sample.keyexpr, None)
                else:
                    found[sample.keyexpr] = sample
            position = page.position
            if not page.more:
                return tuple(found.values())
        return None

    async def changes(
        self, patterns: Sequence[str], position: str, timeout_s: float, limit: int = PAGE
    ) -> Page | None:
        """What changed of the keys that `patterns` match since `position` ("": the beginning).

        None: no store answered that can tell, be it that there is none now (this link may be new),
        or that it is a zenohd storage.

        Raises:
            Unreachable: there is one, but it failed or took longer than `timeout_s`.
        """
        asked = StoreChangesQuery(patterns=tuple(patterns), position=position, limit=limit)
        replies = await self._ask(STORE_CHANGES, asked, timeout_s)
        if replies.errors:
            raise Unreachable(f"the store cannot list what it has: {replies.errors[0]}")
        if replies.timed_out and not replies.values:
            raise Unreachable(f"the store did not answer within {timeout_s:g} s")
        if not replies.values:
            return None
        answer: StoreChanges = decode_reply(STORE_CHANGES, replies.values[0])  # type: ignore[assignment]
        return Page.of(answer)

    async def _settled(self, pattern: str, timeout_s: float) -> tuple[Sample, ...]:
        router = self._link.router
        proven = -1
        while True:
            await router.wait_up()
            generation = router.generation
            replies = await self._link.query(pattern, timeout_s, stored=True)
            newest: dict[str, Sample] = {}
            for sample in replies.values:
                if sample.keyexpr not in newest or newest[sample.keyexpr].stamp < sample.stamp:
                    newest[sample.keyexpr] = sample
            complete = not replies.timed_out and not replies.errors
            values = tuple(sample for sample in newest.values() if not sample.deleted)
            if complete and (values or proven == generation == router.generation):
                return values
            if complete and await self._there(timeout_s):
                proven = generation
                continue
            await asyncio.sleep(0.05)

    async def _there(self, timeout_s: float) -> bool:
        """Whether a store or a storage is there that would have answered by now."""
        if self._link.router.age_s >= SETTLE_S:
            return await self.present(PRESENT_S)
        return await self.answers(timeout_s)

    async def present(self, within_s: float) -> bool:
        """Whether anybody keeps values, or comes to be known within that time."""
        return await self._link.served(_KEPT, within_s)

    async def _newest(self, puts: Sequence[Put], timeout_s: float) -> StoreStamps | None:
        replies = await self._ask(STORE_STAMPS, question_about(puts), timeout_s, puts)
        self._answered = bool(replies.values)
        if not replies.values:
            return None
        answer: StoreStamps = decode_reply(STORE_STAMPS, replies.values[0])  # type: ignore[assignment]
        self._said = answer
        return answer

    async def never_heard_of(self, keyexprs: Collection[str], timeout_s: float) -> set[str]:
        """Those of these keys of which the store holds no write, not even a deletion.

        Raises:
            Unreachable: it cannot say.
        """
        unknown: set[str] = set()
        asked = sorted(keyexprs)
        for at in range(0, len(asked), PAGE):
            keys = tuple(asked[at : at + PAGE])
            answer = await self._stamps_at(keys, timeout_s)
            if answer.failing is not None:
                raise Unreachable(f"the store cannot say what it has: {answer.failing}")
            unknown.update(key for key, at in zip(keys, answer.timestamps, strict=True) if not at)
        return unknown

    async def others(
        self, known: Mapping[str, int], timeout_s: float
    ) -> dict[str, Sample | None] | None:
        """The value, or None, of those of these keys whose last write in the store is another than
        the one with the stamp that is `known`.

        None: the store can write nothing, and so it is not known of any key what it will have.

        Raises:
            Unreachable: it cannot say.
        """
        found: dict[str, Sample | None] = {}
        asked = sorted(known)
        for at in range(0, len(asked), PAGE):
            keys = tuple(asked[at : at + PAGE])
            answer = await self._stamps_at(keys, timeout_s)
            if answer.failing is not None:
                return None
            stamps = dict(zip(keys, answer.timestamps, strict=True))
            others = [key for key in keys if stamps[key] != text_of_stamp(known[key])]
            found |= dict.fromkeys(others)
            if there := [key for key in others if stamps[key]]:
                if (values := await self._paged(there, timeout_s)) is None:
                    raise Unreachable(f"the store did not answer within {timeout_s:g} s")
                found |= {sample.keyexpr: sample for sample in values}
        return found

    async def _stamps_at(self, keys: tuple[str, ...], timeout_s: float) -> StoreStamps:
        replies = await self._ask(STORE_STAMPS, StoreStampsQuery(keys=keys), timeout_s)
        if not replies.values:
            raise Unreachable(f"the store did not answer within {timeout_s:g} s")
        answer: StoreStamps = decode_reply(STORE_STAMPS, replies.values[0])  # type: ignore[assignment]
        return answer

    async def troubles(self, timeout_s: float) -> StoreStamps:
        """What the store says of itself: that it is `failing`, `refusing` or `slowing`."""
        await self._newest((), timeout_s)
        return self._said

    async def clock_s(self, timeout_s: float) -> float | None:
        """The clock of the store's host [s, Unix]; None: no store of ours answers."""
        replies = await self._ask(STORE_CLOCK, StoreClockQuery(), timeout_s)
        if not replies.values:
            return None
        told: StoreClock = decode_reply(STORE_CLOCK, replies.values[0])  # type: ignore[assignment]
        return told.wall_time_s

    async def answers(self, timeout_s: float) -> bool:
        """Whether a store that keeps a journal answers now; a zenohd storage never does."""
        return bool((await self._ask(STORE_JOURNAL, StoreQuery(limit=0), timeout_s)).values)

    async def _ask(
        self, key: Key[Any, P], asked: P, timeout_s: float, after: Sequence[Put] = ()
    ) -> Replies:
        address = StoreAskerAddress(self._asker) if key is STORE_REPLACE else StoreAddress()
        keyexpr = key.build(address)
        self._trace.note("query", key, keyexpr)
        data = key.encode(asked)
        return await self._link.query(
            keyexpr,
            timeout_s,
            data,
            encoding_of(key),
            first=True,
            stored=True,
            after=after,
            attached=self._link.attach(keyexpr, text_of_stamp(0), data, None),
        )
