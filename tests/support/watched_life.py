"""Some who write, some who watch, and a store to which everything happens, in virtual time."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from keyexpr_schema.errors import Overtaken, SchemaError, WriteRefused
from keyexpr_schema.key import Address, Key
from keyexpr_schema.keyspace import (
    FACT,
    GOAL_SPEC,
    GOAL_TREE,
    HOLD,
    ORDER,
    REPORT,
    REPORT_TREE,
    STOP,
)
from keyexpr_schema.limits import Limits
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.payloads.holds import Hold, HoldAddress, HoldKind
from keyexpr_schema.payloads.stops import Stop, StopAddress
from keyexpr_schema.payloads.tasks import Order, OrderAddress, Report, ReportAddress
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.link import Put
from keyexpr_schema.transport.samples import Encoded, decode_value, encoding_of
from keyexpr_schema.transport.selection import TOMBSTONE_S
from keyexpr_schema.transport.stamps import same_session, stamp_of_text
from keyexpr_schema.transport.store.client import StoreClient
from keyexpr_schema.transport.trace import Trace
from keyexpr_schema.transport.undecodable import UndecodableReports
from keyexpr_schema.transport.watch import PUT_BACK_S, Change, Narrowed, Watch
from tests.support.memory_link import MemoryLink, MemoryRouter
from tests.support.memory_store import REALM
from tests.support.virtual_time import Clock, on_host, passing

KEYS: tuple[tuple[Key[Any, Any], Address], ...] = (
    (FACT, FactAddress("cup_1", "at")),
    (FACT, FactAddress("cup_2", "at")),
    (REPORT, ReportAddress("r1", "p1", "t1", 1)),
    (REPORT, ReportAddress("r1", "p2", "t1", 1)),
    (GOAL_SPEC, GoalAddress("g1")),
    (GOAL_SPEC, GoalAddress("g2")),
    (ORDER, OrderAddress("r1", "p1", "t1")),
    (STOP, StopAddress("s1")),
)
TREES = (GOAL_TREE.of(GoalAddress("g1")), REPORT_TREE.of(ReportAddress("r1", "p1", "t1", 1)))
KINDS = (FACT, REPORT, GOAL_SPEC, ORDER, STOP)
PATIENCE_S = 12.0
"""So long somebody waits for what he writes to be confirmed."""
QUIET_S = PUT_BACK_S + 20.0
"""Nothing is said for so long, in the end."""
UNDER_WAY_S = 2.0
"""So long an answer of the store may have been under way, at most."""
NEAR_S = 3.0
"""A clock that is farther behind takes what is stored for something from the future."""
Shown = Change[Any, Any]


def value_of(key: Key[Any, Any], address: Any, text: str) -> Any:
    """A value that says `text`."""
    if key is FACT:
        return Fact(subject=address.subject, relation="at", value=text, source="test")
    if key is GOAL_SPEC:
        return Goal(goal=address.goal, text=text)
    if key is STOP:
        return Stop(stop=address.stop, reason=text)
    about = {"robot": address.robot, "plan": address.plan, "task": address.task, "revision": 1}
    if key is ORDER:
        said = {"attempt": 1, "epoch": 1, "skill": "go", "args": {"to": text}, "deadline_s": 1.0}
        return Order(**about, **said)
    attempt = {"attempt": address.attempt, "epoch": 1, "incarnation": "i", "state": "started"}
    return Report(**about, **attempt, reason=text)


def text_of(value: Any) -> str | None:
    """What a value says, in short."""
    return value and str(re.findall(r"'(v\d+)", repr(value))[0])


@dataclass
class Session:
    """One who takes part, on a host of its own."""

    link: MemoryLink
    store: StoreClient

    @property
    def clock(self) -> Clock:
        return self.link.clock


class Watcher:
    """What one watch shows. With `puts_back` whoever watches writes again what a store has lost."""

    def __init__(self, life: Life, name: str, session: Session, *, puts_back: bool) -> None:
        self.name, self.session, self._life = name, session, life
        self.on_lost = self._put_back if puts_back else None
        self.shown: dict[str, Shown] = {}
        self.said: dict[str, list[Shown]] = {}
        self.all_shown: list[tuple[str, Shown]] = []
        self.odd: list[str] = []
        """What it has shown against the laws that hold on the way."""
        self.watch: Watch | None = None

    async def follow(self, watch: Watch) -> None:
        async for change in watch:
            keyexpr = change.key.build(change.address)
            self._mind(keyexpr, change)
            self.shown[keyexpr] = change
            self.said.setdefault(keyexpr, []).append(change)
            self.all_shown.append((keyexpr, change))

    def _mind(self, keyexpr: str, change: Shown) -> None:
        before, taken = self.shown.get(keyexpr), self._life.router.taken
        if before is None or self._life.router.set_back or self.session.clock.ahead_s < -NEAR_S:
            return
        was, now = stamp_of_text(before.timestamp), stamp_of_text(change.timestamp)
        was_s, again_s = (taken.get((keyexpr, stamp), 0.0) for stamp in (was, now))
        now_s = asyncio.get_running_loop().time()
        known = again_s <= was_s < now_s - UNDER_WAY_S
        known = known and (before.value is not None or was_s > now_s - TOMBSTONE_S)
        if same_session(was, now) and now < was and known and was_s:
            self.odd.append(f"{keyexpr} went back from {before.timestamp} to {change.timestamp}")
        if "in order" in self.name and change.key.by_receipt and change.received:
            last = max((each.received for each in self.said[keyexpr]), default=0)
            if change.received <= last:
                self.odd.append(f"{keyexpr} has the receipt {change.received} after {last}")

    def out_of_turn(self) -> str:
        """What goes by receipt and is shown after what its writer has put of another key later, and
        has passed; what the store says comes in the order in which it has taken that in."""
        turns = {
            (put.keyexpr, stamp_of_text(str(put.timestamp))): (link.number, number)
            for link in self._life.router.links
            for number, put in reversed(list(enumerate(link.sent)))
        }
        last: dict[int, int] = {}
        for keyexpr, change in self.all_shown:
            link, turn = turns.get((keyexpr, stamp_of_text(change.timestamp)), (0, 0))
            if change.key.by_receipt and change.received and turn < last.get(link, 0):
                return f"{keyexpr} of {change.timestamp}"
            if not change.key.by_receipt and not change.received:
                last[link] = max(turn, last.get(link, 0))
        return ""

    def _put_back(self, lost: Sequence[tuple[Key[Any, Any], Address]]) -> None:
        for key, address in lost:
            known = self.shown.get(key.build(address))
            if known is not None and known.value is not None:
                age_s = time.time() - known.received / 1e6 if known.received else 0.0
                writing = self._keep_writing(key, address, known.value, max(0.0, age_s))
                self._life.begin(writing, self.session)

    async def _keep_writing(
        self, key: Key[Any, Any], address: Address, value: Any, age_s: float
    ) -> None:
        """Until the store has it, or something that holds instead."""
        began_s = asyncio.get_running_loop().time()
        while True:
            late_s = age_s + asyncio.get_running_loop().time() - began_s
            data = key.check(value, address)
            try:
                await self.session.store.write(key, key.build(address), data, PATIENCE_S, late_s)
                return
            except (Overtaken, WriteRefused):
                return
            except SchemaError:
                await passing(1.0)

    def differs(self, stored: dict[str, Any]) -> str:
        """Where the last word that was shown is not what is stored; empty: nowhere."""
        for key, address in KEYS:
            keyexpr = key.build(address)
            if self._life.is_shown(self.name, keyexpr):
                change = self.shown.get(keyexpr)
                shown = None if change is None else change.value
                if shown != stored.get(keyexpr):
                    said = [(text_of(c.value), c.timestamp) for c in self.said.get(keyexpr, [])]
                    there = text_of(stored.get(keyexpr))
                    return f"{self.name}: of {keyexpr} {there} is stored, and was shown {said}"
        return ""


class Life:
    """A router with its store, three who write, and a watch of each kind; `seed`: of what is drawn
    at random. `puts_back`: some write again what the store has lost."""

    def __init__(self, folder: Path, seed: int, limits: Limits, *, puts_back: bool = True) -> None:
        self._random, self._puts_back = Random(seed), puts_back
        self.router = MemoryRouter(folder, self._random, limits)
        self.tasks: set[asyncio.Task[None]] = set()
        self.writers: list[Session] = []
        self.watchers: list[Watcher] = []
        self._number = 0

    def session(self, ahead_s: float = 0.0) -> Session:
        """One more who takes part."""
        link = MemoryLink(self.router, len(self.router.links) + 1, Clock(ahead_s), self._random)
        return Session(link, StoreClient(link, (), Trace("test"), "op"))  # type: ignore[arg-type]

    @asynccontextmanager
    async def begun(self, ahead_s: Sequence[float]) -> AsyncIterator[Life]:
        """The router runs, and everybody is there; `ahead_s`: by how much whose clock is wrong."""
        self.router.start()
        all_keys = tuple((key, key.pattern(), None) for key in KINDS)
        reports = Narrowed(REPORT, "plan", lambda: {"p1"})
        narrowed = (
            (REPORT, REPORT.pattern(), reports), (FACT, FACT.pattern(), None)
        )  # fmt: skip
        async with AsyncExitStack() as stack:
            self.writers = [self.session(each) for each in ahead_s[:3]]
            for number, (name, selections, how) in enumerate((
                ("plain", all_keys, {}),
                ("plain, a writer's", all_keys, {}),
                ("plain, of known keys", all_keys, {"known": KEYS}),
                ("collected", all_keys, {"collect_s": 0.3}),
                ("in order", all_keys, {"in_order": True}),
                ("in order, narrowed", narrowed, {"in_order": True}),
                ("in order, puts back", all_keys, {"in_order": True}),
                ("plain, puts back", all_keys, {}),
            )):  # fmt: skip
                own = "a writer's" in name
                session = self.writers[0] if own else self.session(ahead_s[3 + number])
                await self._watch(stack, name, session, selections, how)
            stack.callback(self._end)
            yield self

    def _end(self) -> None:
        for task in self.tasks:
            task.cancel()
        self.router.stop()

    async def _watch(
        self,
        stack: AsyncExitStack,
        name: str,
        session: Session,
        selections: Sequence[Any],
        how: dict[str, Any],
    ) -> None:
        puts_back = self._puts_back and "puts back" in name
        watcher = Watcher(self, name, session, puts_back=puts_back)
        link: Any = session.link
        undecodable = UndecodableReports(link, "test", Trace("test"))
        with on_host(session.clock):
            watch = Watch(
                link, session.store, undecodable, selections, on_lost=watcher.on_lost, **how
            )
            running = await stack.enter_async_context(watch.running())
            watcher.watch = running
            following = asyncio.create_task(watcher.follow(running))
        stack.callback(following.cancel)
        self.watchers.append(watcher)

    @staticmethod
    def is_shown(watch: str, keyexpr: str) -> bool:
        """Whether a watch is about a key, all of the time."""
        return "narrowed" not in watch or keyexpr.startswith(("world/", "robots/r1/reports/p1"))

    # --- what is said ----------------------------------------------------------------------------

    def begin(self, act: Any, session: Session) -> None:
        """Have somebody do something."""

        async def done() -> None:
            with suppress(SchemaError):
                await act

        with on_host(session.clock):
            task = asyncio.create_task(done())
        self.tasks.add(task)
        task.add_done_callback(self.tasks.discard)

    def _data(self, key: Key[Any, Any], address: Address, size: int = 1) -> bytes:
        self._number += 1
        data: bytes = key.check(value_of(key, address, f"v{self._number}" * size), address)
        return data

    def confirm(self, who: int, what: int, *, age_s: float = 0.0, size: int = 1) -> None:
        """Say something, and wait until the store has it."""
        key, address = KEYS[what]
        data = self._data(key, address, size)
        store = self.writers[who].store
        writing = store.write(key, key.build(address), data, PATIENCE_S, age_s)
        self.begin(writing, self.writers[who])

    def put(
        self, who: int, what: int, *, deleted: bool = False, age_s: float | None = None
    ) -> None:
        """Say something, and do not look back."""
        key, address = KEYS[what]
        link = self.writers[who].link
        data = None if deleted else self._data(key, address)
        said_s = None if age_s is None else asyncio.get_running_loop().time() - age_s
        stamp = link.new_timestamp()
        link.put(Put(key.build(address), data, encoding_of(key), stamp, said_s))

    def delete(self, who: int, what: int) -> None:
        """Delete something, and wait until the store has done so."""
        key, address = KEYS[what]
        store = self.writers[who].store
        self.begin(store.write(key, key.build(address), None, PATIENCE_S), self.writers[who])

    def delete_tree(self, who: int, what: int) -> None:
        """Delete all that is about something."""
        pattern = TREES[what % len(TREES)]
        store = self.writers[who].store
        self.begin(store.delete_matching(GOAL_SPEC, pattern, PATIENCE_S), self.writers[who])

    def again(self, who: int, what: int) -> None:
        """Say again what was said."""
        link = self.writers[who].link
        if link.sent:
            link.put(link.sent[-1 - what % len(link.sent)])

    def replace(self, who: int, what: int) -> None:
        """Have the store compare and set."""
        key, address = KEYS[what]
        store, data = self.writers[who].store, self._data(key, address)

        async def look_and_replace() -> None:
            keyexpr = key.build(address)
            seen = next(iter(await store.list(keyexpr, PATIENCE_S)), None)
            await store.replace(key, keyexpr, data, seen, PATIENCE_S)

        self.begin(look_and_replace(), self.writers[who])

    # --- in the end ------------------------------------------------------------------------------

    async def come_to_rest(self) -> None:
        """All is well again, whatever is under way ends, and then nothing more is said of what is
        watched: of something else yes, by a right clock, as otherwise a store does not see that it
        can write again.
        """
        self.router.start()
        self.router.fill(False)
        for link in self.router.links:
            link.cut, link.loses = False, 0.0
            link.find()
        somebody = self.session()
        self.begin(self._say_something_else(somebody), somebody)
        await passing(QUIET_S)
        while self.tasks:
            await self.at_rest()
            await passing(QUIET_S)

    async def at_rest(self) -> None:
        """Whatever is under way ends."""
        while self.tasks:
            await asyncio.wait(self.tasks)

    @staticmethod
    async def _say_something_else(somebody: Session) -> None:
        address = HoldAddress("h1")
        data = HOLD.check(Hold(hold="h1", kind=HoldKind.PAUSE), address)
        await somebody.store.write(HOLD, HOLD.build(address), data, QUIET_S)

    def stored(self) -> dict[str, Any]:
        """What the store has, by key."""
        assert self.router.served is not None
        found = {}
        kinds = {key.build(address): key for key, address in KEYS}
        for write in self.router.served.store.select(f"{REALM}/**"):
            keyexpr = write.keyexpr[len(REALM) + 1 :]
            if keyexpr not in kinds:
                continue
            found[keyexpr] = decode_value(
                kinds[keyexpr], Encoded(keyexpr, write.data, write.encoding)
            )
        return found
