"""A router with its store, and links to it, in memory: for what is to be seen in virtual time.

What a link brings comes in the order in which
one sender sent it, later or sooner than what another one sent. What is on its way when a link
breaks is lost, and what is put while there is none, too. Whoever puts something hears it himself at
once.
"""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from contextvars import Context, copy_context
from functools import lru_cache
from pathlib import Path
from random import Random

import zenoh

from keyexpr_schema.limits import Limits
from keyexpr_schema.transport.attachments import unsigned
from keyexpr_schema.transport.link import Put, Replies
from keyexpr_schema.transport.router_presence import RouterPresence
from keyexpr_schema.transport.samples import Encoded, Sample
from keyexpr_schema.transport.session_stamps import SessionStamps
from keyexpr_schema.transport.stamps import stamp_of_text
from tests.support.memory_store import HybridClock, ServedStore
from tests.support.virtual_time import Clock, passing

Receive = Callable[[Sample], None]
Answer = Callable[[Replies], None]


@lru_cache(maxsize=4096)
def _meet(pattern: str, keyexpr: str) -> bool:
    return zenoh.KeyExpr(pattern).intersects(keyexpr)


class MemoryRouter:
    """A router on a host with a right clock, its store in `folder`; its limits are `limits`."""

    def __init__(self, folder: Path, random: Random, limits: Limits) -> None:
        self._folder, self._random, self._limits = folder, random, limits
        self.clock = Clock()
        self.served: ServedStore | None = None
        """The store, while the router runs."""
        self.taken: dict[tuple[str, int], float] = {}
        self.set_back = 0
        """How often its store was replaced by an earlier one."""
        self.slowest_s = 0.05
        self.links: list[MemoryLink] = []
        self.context = Context()
        """In which it is as late as it is on the router's host."""
        self._copies = 0

    def later(self, act: Callable[[], object]) -> None:
        """Do something in a moment, unless the store is gone by then."""
        delay_s, served = self._random.random() * self.slowest_s, self.served

        def do() -> None:
            if self.served is served:
                act()

        asyncio.get_running_loop().call_later(delay_s, do, context=self.context)

    @property
    def full(self) -> bool:
        return self.served is not None and self.served.store.full

    def fill(self, full: bool) -> None:
        """Nothing can be written any more, or again."""
        if self.served is not None:
            self.served.store.full = full

    def start(self) -> None:
        """It is there again, with what its folder has; links come back by themselves."""
        if self.served is None:
            self.served = ServedStore(self, self._folder / "store", self._limits)
            self.served.store.taken = self.taken
            for link in self.links:
                link.find()

    def stop(self) -> None:
        """It is gone, with all that is on its way."""
        if self.served is not None:
            self.served.store.close()
            self.served = None
            for link in self.links:
                link.lose()

    def copy(self) -> None:
        """Keep what the store has now."""
        self._copies += 1
        shutil.copytree(self._folder / "store", self._folder / f"copy-{self._copies}")

    def go_back(self, *, to_nothing: bool = False) -> None:
        """Start again with what was kept last, or with nothing."""
        self.stop()
        shutil.rmtree(self._folder / "store")
        if self._copies and not to_nothing:
            shutil.copytree(self._folder / f"copy-{self._copies}", self._folder / "store")
        self.set_back += 1
        self.start()

    def spread(self, sender: MemoryLink | None, sample: Sample) -> None:
        """Bring a value to all others."""
        for link in self.links:
            if link is not sender:
                link.brings(sender, sample)


class MemoryLink:
    """What a session has of a `Link`, whose host's clock is `clock`."""

    def __init__(self, router: MemoryRouter, number: int, clock: Clock, random: Random) -> None:
        self._router, self._random, self.clock = router, random, clock
        self.number = number
        self.stamps = SessionStamps(HybridClock(number, clock), clock.now_ns)  # type: ignore[arg-type]
        self.router = RouterPresence()
        self.attach = unsigned
        self.cut = False
        self.loses = 0.0
        """What part of what passes does not come."""
        self._receivers: list[tuple[str, Receive]] = []
        self._last_s: dict[object, float] = {}
        self._known_s = 0.0
        self.sent: list[Put] = []
        router.links.append(self)
        self.find()

    # --- the link --------------------------------------------------------------------------------

    @property
    def up(self) -> bool:
        return not self.cut and self._router.served is not None

    def find(self) -> None:
        """Connect, if the router is there and nobody has cut the line; soon the store is known."""
        if self.up and not self.router.up:
            self.router.count("router", True)
            now_s = asyncio.get_running_loop().time()
            self._known_s = now_s + self._random.choice((0.0, 0.1 * self._random.random()))

    def lose(self) -> None:
        """The link is broken."""
        if self.router.up:
            self.router.count("router", False)

    def _in_order(self, sender: object, act: Callable[[], None], beyond: MemoryLink) -> None:
        """Do something a little later, after what came from the same sender before, if then the
        link is still the same."""
        loop = asyncio.get_running_loop()
        delay_s = self._random.random() * self._router.slowest_s
        at_s = max(self._last_s.get(sender, 0.0), loop.time() + delay_s)
        self._last_s[sender] = at_s + 1e-6
        generation, served = beyond.router.generation, self._router.served

        def arrive() -> None:
            same = beyond.router.generation == generation and self._router.served is served
            if same and beyond.up and served is not None:
                act()

        loop.call_at(at_s, arrive, context=self._router.context)

    # --- values ----------------------------------------------------------------------------------

    def new_timestamp(self) -> zenoh.Timestamp:
        return self.stamps.new()

    async def send(self, put: Put) -> None:
        self.put(put)

    def send_together(self, puts: Sequence[Put]) -> None:
        for put in puts:
            self.put(put)

    def put(self, put: Put) -> None:
        """Put and forget."""
        keyexpr, data, encoding, timestamp, said_s = put
        self.sent.append(put)
        late_us = None if said_s is None else round(max(0.0, self._time() - said_s) * 1e6)
        attached = (self.attach(keyexpr, str(timestamp), data, late_us) or "").encode()
        stamp = stamp_of_text(str(timestamp))
        sample = Sample(keyexpr, data or b"", encoding, stamp, data is None, attached=attached)
        asyncio.get_running_loop().call_soon(self.hears, sample)
        if self.up:
            self._in_order(self, lambda: self._arrives(sample), self)

    def send_soon(self, keyexpr: str, data: bytes, encoding: str, *, block: bool) -> None:
        """What nobody here listens to."""

    @staticmethod
    def _time() -> float:
        return asyncio.get_running_loop().time()

    def _arrives(self, sample: Sample) -> None:
        assert self._router.served is not None
        self._router.served.came(sample)
        self._router.spread(self, sample)

    def brings(self, sender: MemoryLink | None, sample: Sample) -> None:
        """A value is on its way to here."""
        if self.up and self._random.random() >= self.loses:
            self._in_order((sender,), lambda: self.hears(sample), self)

    def hears(self, sample: Sample) -> None:
        for pattern, receive in list(self._receivers):
            if _meet(pattern, sample.keyexpr):
                receive(sample)

    async def query(
        self,
        keyexpr: str,
        timeout_s: float,
        data: bytes | None = None,
        encoding: str | None = None,
        *,
        first: bool = False,
        stored: bool = False,
        after: Sequence[Put] = (),
        attached: str | None = None,
    ) -> Replies:
        for put in after:
            self.put(put)
        if not self.up or self._time() < self._known_s:
            await passing(0.001)
            return Replies()
        done: asyncio.Future[Replies] = asyncio.get_running_loop().create_future()
        question = Encoded(keyexpr, data or b"{}", encoding or "")

        def answer(replies: Replies) -> None:
            def back() -> None:
                if not done.done():
                    done.set_result(replies)

            self._in_order(done, back, self)

        def asks() -> None:
            assert self._router.served is not None
            self._router.served.asked(question, answer)

        self._in_order(self, asks, self)
        try:
            async with asyncio.timeout(timeout_s):
                return await done
        except TimeoutError:
            return Replies(timed_out=True)

    async def served(self, keyexpr: str, within_s: float) -> bool:
        until_s = self._time() + within_s
        while not (self.up and self._time() >= self._known_s):
            if self._time() >= until_s:
                return False
            await passing(0.01)
        return True

    # --- subscribers -----------------------------------------------------------------------------

    @asynccontextmanager
    async def subscribed(self, keyexpr: str, receive: Receive) -> AsyncIterator[None]:
        context = copy_context()
        entry = (keyexpr, lambda sample: context.run(receive, sample))
        self._receivers.append(entry)
        try:
            yield
        finally:
            self._receivers.remove(entry)

    @asynccontextmanager
    async def collected(
        self, receivers: Sequence[tuple[str, Receive]]
    ) -> AsyncIterator[Callable[[], bool]]:
        waiting: list[tuple[Sample, Receive]] = []
        entries: list[tuple[str, Receive]] = [
            (keyexpr, lambda sample, receive=receive: waiting.append((sample, receive)))
            for keyexpr, receive in receivers
        ]
        self._receivers += entries

        def collect() -> bool:
            taken, waiting[:] = sorted(waiting, key=lambda one: one[0].stamp), []
            for sample, receive in taken:
                receive(sample)
            return False

        try:
            yield collect
        finally:
            self._receivers = [each for each in self._receivers if each not in entries]
