"""Level-triggered watching of keys: what is stored, then what changes, then what was missed.

Our store keeps its changes in order. Once everything was listed, page by page, a watch asks every
now and then, and after each reconnection, what has changed since: one question, and an empty answer
when nothing has. It lists everything again only where the store cannot say (it is another one, or
has forgotten deletions). What is in no page is gone.

What passes on the link is shown at once, and the store may never take it in: it is too late, or too
large. What the store has not said by the next question is asked for by name, and what it has holds.

A storage that cannot say at all (zenohd's) is listed again and again, the more seldom the longer a
listing takes, and there deletions are a matter of their own. One that passes on the link is
believed. One that was missed shows only as a key that a listing lacks, and empty is not absent:
after a reconnection Zenoh answers with less than there is, and a storage that is away answers with
nothing. So a key is taken for deleted when two listings in a row lack it, both taken in one
generation of the link, and the second one was not empty.

A watch that is `in_order` takes keys that go by receipt from our store alone, in the order in which
it received them: what passes only says that there is something to ask for, and what passes of other
keys meanwhile waits for the answer. What this session itself has put it knows: that has time until
the next question about something else, or until something passes that is to come after it.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Callable, Iterable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from enum import Enum, auto
from functools import partial
from typing import Any

from keyexpr_schema.authors import is_signed
from keyexpr_schema.errors import Unreachable
from keyexpr_schema.key import Address, Delivery, Key
from keyexpr_schema.key_lookup import shape
from keyexpr_schema.keyspace import REVOCATIONS
from keyexpr_schema.transport.change_stream import ChangeStream
from keyexpr_schema.transport.link import Link
from keyexpr_schema.transport.live_signatures import Judges
from keyexpr_schema.transport.samples import Sample
from keyexpr_schema.transport.selection import Change, Narrowed, Selection
from keyexpr_schema.transport.store.client import SETTLE_S, StoreClient
from keyexpr_schema.transport.store_first import AGAIN_S, StoreFirst
from keyexpr_schema.transport.undecodable import UndecodableReports
from keyexpr_schema.transport.unsaid import DOUBT_S, RELIST_S

__all__ = ["RELIST_S", "Change", "Narrowed", "Watch"]

LISTING_SHARE = 0.02
"""Of its time, what a watch may spend on listing a storage that cannot say what has changed."""
ANSWER_S = 3.0
"""How long the store may take for one answer; a long listing has many."""
OWN_S = 0.1
"""So long after it has passed the store is asked for what this session itself has put."""
PUT_BACK_S = 30.0
"""So long whoever is told of it has to write again what a store has lost."""
_RETRY_S = 0.2
Deliver = Callable[[str, Change[Any, Any]], None]
OnLost = Callable[[Sequence[tuple[Key[Any, Any], Address]]], None]
"""Hears of keys of which a store has lost the values."""

log = logging.getLogger(__name__)


class _Said(Enum):
    """What a store has said of what was missed."""

    ALL = auto()
    NOT_SINCE_THEN = auto()
    """It cannot say what has changed since; everything has to be listed."""
    NOTHING = auto()
    """No store answers that could: there is none, or one that only keeps values."""


class Watch(ChangeStream[Change[Any, Any]]):
    """An async iterator of `Change`; made by `Session.watch`.

    Values of `STREAM` and `LATEST` keys that were not taken yet are replaced by newer ones of the
    same key; of other keys every change that was seen is delivered. `on_trouble` hears why the
    stored values cannot be read, once for each spell, and None when they can be again. Values are
    collected every `collect_s`, if that is given, instead of one by one.
    """

    def __init__(
        self,
        link: Link,
        store: StoreClient,
        undecodable: UndecodableReports,
        selections: Sequence[tuple[Key[Any, Any], str, Narrowed | None]],
        known: Iterable[tuple[Key[Any, Any], Address]] = (),
        on_trouble: Callable[[str | None], None] | None = None,
        collect_s: float | None = None,
        in_order: bool = False,
        on_lost: OnLost | None = None,
        judges: Judges | None = None,
    ) -> None:
        super().__init__()
        self._on_lost = on_lost
        self._collect_s, self._in_order = collect_s, in_order
        self._waiting: Callable[[], bool] | None = None
        self._first: StoreFirst[tuple[Selection, Sample]] = StoreFirst(
            asyncio.get_running_loop().time
        )
        self._later: asyncio.TimerHandle | None = None
        """When the store is asked for what this session itself has put."""
        self._ours = True
        """Whether a store of ours is there, which can be asked first."""
        self._link, self._store = link, store
        self._judges = judges if any(is_signed(key) for key, _, _ in selections) else None

        def selected(
            selection: tuple[Key[Any, Any], str, Narrowed | None], deliver: Deliver
        ) -> Selection:
            judge = None if self._judges is None else self._judges.new()
            now_s = link.stamps.now_s
            return Selection(*selection, undecodable, deliver, self.relist, now_s, judge)

        self._selections = [selected(each, self._deliver) for each in selections]
        if self._judges is not None:
            lists = REVOCATIONS, self._judges.pattern(), None
            self._selections.append(selected(lists, self._learn))
        self._stored = [each for each in self._selections if each.key.stored]
        self._of_shape: dict[tuple[str, int], list[Selection]] = {}
        """The stored ones by the shape of their keys: few of them match what the store says."""
        for each in self._stored:
            self._of_shape.setdefault(shape(each.pattern), []).append(each)
        for key, address in known:
            for selection in self._selections:
                if selection.key is key:
                    selection.expect(key.build(address))
        self._position = ""
        """Up to where the changes of the store are known; empty: everything has to be listed."""
        self._on_trouble = on_trouble
        self._trouble: str | None = None
        self._asks_at_s = 0.0
        self.listings = 0
        """How often all that is stored was listed."""
        self.updates = 0
        """How often what is known was brought up to date, by a listing or otherwise."""

    def relist(self, after_s: float = 0.0) -> None:
        """Ask soon for what was missed, or after so long [s], once for all that is doubted then."""
        loop = asyncio.get_running_loop()
        if not after_s:
            self._wake.set()
        elif self._asks_at_s <= loop.time():
            self._asks_at_s = loop.call_later(after_s, self._wake.set).when()

    def exists(self, key: Key[Any, Any], address: Address) -> bool:
        """Whether the key has a value, as far as is known; it may be one that cannot be read."""
        keyexpr = key.build(address)
        return any(each.key is key and keyexpr in each for each in self._selections)

    @property
    def remembered(self) -> int:
        """How many keys are remembered."""
        return sum(len(each) for each in self._selections)

    def _learn(self, _: str, change: Change[Any, Any]) -> None:
        if self._judges is not None:
            self._judges.learn(change.address, change.value)

    def _deliver(self, keyexpr: str, change: Change[Any, Any]) -> None:
        latest = change.key.delivery in (Delivery.STREAM, Delivery.LATEST)
        self._add(change, keyexpr if latest else None)

    @asynccontextmanager
    async def running(self) -> AsyncIterator[Watch]:
        """Subscribe, then list and keep up to date, until the block ends."""
        async with AsyncExitStack() as stack:
            receivers = [
                (selection.pattern, partial(self._passed, selection))
                for selection in self._selections
            ]
            if self._collect_s is None:
                for receiver in receivers:
                    await stack.enter_async_context(self._link.subscribed(*receiver))
            else:
                self._waiting = await stack.enter_async_context(self._link.collected(receivers))
                collecting = self._keep_collecting(self._collect_s)
                await stack.enter_async_context(self._in_background(collecting))
            stack.enter_context(self._link.router.listening(self.relist))
            yield await stack.enter_async_context(self._in_background(self._keep_up_to_date()))

    def _passed(self, selection: Selection, sample: Sample) -> None:
        """Take in what passes on the link."""
        if not (self._in_order and self._ours) or "*" in sample.keyexpr:
            selection.heard(sample)
        elif selection.key.by_receipt and self._link.stamps.made(sample.stamp):
            self._first.asks_later(sample.keyexpr, sample.stamp)
            if self._later is None:
                self._later = asyncio.get_running_loop().call_later(OWN_S, self._ask_for_own)
        elif selection.key.by_receipt:
            self._first.asks(sample.keyexpr, sample.stamp)
            self.relist()
        else:
            self._ask_for_own()
            if self._first.holds:
                self._first.hold((selection, sample))
            else:
                selection.heard(sample)

    def _ask_for_own(self) -> None:
        """It has waited for long, or what passes now would come before it."""
        if self._later is not None:
            self._later.cancel()
            self._later = None
        if self._first.asks_now():
            self.relist()

    def _taken(self, sample: Sample) -> None:
        """Take in what the store says."""
        self._first.came(sample.keyexpr, sample.stamp)
        for selection in self._of_shape.get(shape(sample.keyexpr), ()):
            selection.changed(sample)

    def _release(self) -> None:
        """What has waited for what the store says is taken in."""
        for selection, sample in self._first.answered():
            selection.heard(sample)

    async def _keep_collecting(self, every_s: float) -> None:
        while True:
            self._collect()
            await asyncio.sleep(every_s)

    def _collect(self) -> None:
        """Take in what has passed and waits; before what the store says, which has only the last of
        each key."""
        if self._waiting is not None and self._waiting():
            self.relist()

    async def _keep_up_to_date(self) -> None:
        if not self._stored:
            self._synced.set()
            return
        loop = asyncio.get_running_loop()
        failures = 0
        while True:
            self._wake.clear()
            begun_s, generation = loop.time(), self._link.router.generation
            try:
                pause_s = _RETRY_S
                if await self._update():
                    took_s = 0.0 if self._position else loop.time() - begun_s
                    pause_s = max(RELIST_S, took_s / LISTING_SHARE)
                    if self._judges is not None:
                        self._judges.informs(generation)
                    self._synced.set()
                    await self._settle(begun_s - DOUBT_S)
                self.updates += 1
                failures = 0
                self._tell(None)
            except Unreachable as error:
                failures += 1
                pause_s = min(RELIST_S, _RETRY_S * 2**failures)
                self._tell(str(error))
            self._release()
            for selection in self._selections:
                selection.forget()
            if self._first:
                pause_s = AGAIN_S
            elif any(selection.contested for selection in self._stored):
                pause_s = min(pause_s, DOUBT_S)
            await self._woken(pause_s)

    def _tell(self, trouble: str | None) -> None:
        """Say that the store cannot be read, or can be again; once, and not while no router is
        there, which the link says itself."""
        if trouble is not None and not self._link.router.up:
            return
        if (trouble is None) != (self._trouble is None):
            if trouble is None:
                log.info("what is stored can be read again")
            else:
                log.warning("what is stored cannot be read, tries again: %s", trouble)
            if self._on_trouble is not None:
                self._on_trouble(trouble)
        self._trouble = trouble

    async def _update(self) -> bool:
        """Take in what was missed; whether that is all, or a look has to follow soon."""
        loop = asyncio.get_running_loop()
        asked_s = loop.time()
        said = await self._take_changes() if self._position else _Said.NOT_SINCE_THEN
        if said is _Said.NOT_SINCE_THEN:
            said = await self._list()
        # A store may be there, and not be known to a link that was new when it asked, or broke.
        settled_s = self._link.router.age_s - (loop.time() - asked_s)
        if said is _Said.ALL or settled_s < SETTLE_S:
            return said is _Said.ALL
        complete, self._ours = True, False
        for selection in self._stored:
            complete &= await self._list_storage(selection)
        self.listings += 1
        return complete

    async def _take_changes(self) -> _Said:
        """Take in what changed since the last time."""
        patterns = [selection.pattern for selection in self._stored]
        while True:
            page = await self._store.changes(patterns, self._position, ANSWER_S)
            if page is None:
                return _Said.NOTHING
            if page.whole:
                return _Said.NOT_SINCE_THEN
            self._ours = True
            self._collect()
            for sample in page.samples:
                self._taken(sample)
            self._position = page.position
            if not page.more:
                return _Said.ALL

    async def _list(self) -> _Said:
        """Take in all that is stored, page by page."""
        for selection in self._stored:
            selection.forget()
        known = [(selection, selection.known()) for selection in self._stored]
        another, older = bool(self._position), set[str]()
        patterns = [pattern for selection in self._stored for pattern in selection.patterns()]
        listed: set[str] = set()
        position = ""
        while (page := await self._store.changes(patterns, position, ANSWER_S)) is not None:
            if page.whole:
                listed.clear()
            self._collect()
            for sample in page.samples:
                (listed.discard if sample.deleted else listed.add)(sample.keyexpr)
                if another and any(each.is_older(sample, before) for each, before in known):
                    older.add(sample.keyexpr)
                self._taken(sample)
            position = page.position
            if not page.more:
                break
        else:
            return _Said.NOTHING
        missing = [(selection, selection.missing(before, listed)) for selection, before in known]
        await self._sort_out(missing, older)
        self._position, self._ours = position, True
        self.listings += 1
        return _Said.ALL

    async def _settle(self, since_s: float) -> None:
        """What has passed on the link by then, and the store has not said, it has not taken in, or
        not yet: for each such key what it has instead holds."""
        if not self._ours:
            for selection in self._stored:
                selection.trust()
            return
        for selection in self._stored:
            known = selection.doubtful(since_s)
            if (others := await self._store.others(known, ANSWER_S)) is not None:
                selection.believe(known, others)

    async def _sort_out(self, missing: list[tuple[Selection, set[str]]], older: set[str]) -> None:
        """Of what a listing lacks, what was deleted is delivered as such. What the store never
        heard of it has lost, as what it has an older value of."""
        gone = set[str]().union(*(keyexprs for _, keyexprs in missing))
        lost = set[str]()
        if self._on_lost is not None and gone:
            lost = await self._store.never_heard_of(gone, ANSWER_S)
        for selection, keyexprs in missing:
            selection.delete(keyexprs - lost)
        if self._on_lost is not None and (lost or older):
            told = (
                (selection.key, selection.key.parse(keyexpr))
                for selection in self._stored
                for keyexpr in sorted(lost | older)
                if keyexpr in selection and selection.key is not REVOCATIONS
            )
            self._on_lost(list(told))
            for selection in self._stored:
                for keyexpr in lost | older:
                    selection.doubt(keyexpr, PUT_BACK_S)

    async def _list_storage(self, selection: Selection) -> bool:
        """List what a storage has; False if something known was not in it and has to be looked for
        again."""
        router, generation = self._link.router, self._link.router.generation
        selection.forget()
        known = selection.known()
        listed: set[str] = set()
        for pattern in list(selection.patterns()):
            found = await self._store.list(pattern, ANSWER_S)
            self._collect()
            for sample in found:
                selection.offer(sample)
                listed.add(sample.keyexpr)
        if router.generation != generation or not router.up:
            return False
        missing = selection.missing(known, listed)
        again = selection.missing_twice(missing, generation)
        # An empty listing looks like one of a storage that is away.
        if again and (listed or await self._store.answers(1.0)):
            selection.delete(again)
        return missing == again
