"""Publishes what the core wants published, each key in turn, until the store has confirmed it."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import AsyncIterator, Iterable, Iterator
from contextlib import asynccontextmanager
from itertools import chain

from fleet.core.effects import Publish, Retract
from fleet.service.put_back import PutBack
from keyexpr_schema.errors import Overtaken, SchemaError, UndecodablePayload, WriteRefused
from keyexpr_schema.transport.session import Session

CONFIRM_TIMEOUT_S = 10.0
IN_FLIGHT = 32
"""Keys written at the same time; a confirmed put takes under a millisecond."""
_RETRY_S = 0.2
REFUSED_AGAIN_S = 10.0
"""After that it is tried again to write what is beyond a limit of the store."""

log = logging.getLogger(__name__)


class Outbox:
    """Holds the newest wanted value of each key and writes it; older ones are skipped.

    Nothing is given up: while no router is there, writes wait.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._wanted: dict[str, tuple[Publish | Retract, float]] = {}
        """And since when, on the clock of `time.monotonic`."""
        self._unwritten: set[str] = set()
        """Keys that are being written, or wait for it."""
        self._next: deque[tuple[str, bool]] = deque()
        """Those that wait, and whether they were refused before; thousands, when a large plan
        begins, and so without a task of their own, which Python's garbage collector would go
        through again and again."""
        self._first: deque[tuple[str, bool]] = deque()
        """Those that a store has lost and that are put back, before the others: after a while the
        planner believes the store (`transport.watch.PUT_BACK_S`)."""
        self._writing: dict[str, Publish | Retract] = {}
        self._writers: set[asyncio.Task[None]] = set()
        self._refused: deque[str] = deque()
        """Keys that are tried again now and then, some at a time; meanwhile others are written."""
        self._trying: asyncio.TimerHandle | None = None
        self._written: dict[str, asyncio.Future[None]] = {}
        """For those who wait until nothing is left to be written at a key."""

    @asynccontextmanager
    async def running(self) -> AsyncIterator[Outbox]:
        """Write until the block ends; what was not written by then is left to the next start."""
        try:
            yield self
        finally:
            tasks = list(self._writers)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            if self._trying is not None:
                self._trying.cancel()
            for waited_for in self._written.values():
                waited_for.cancel()

    @property
    def unconfirmed(self) -> Iterator[Publish | Retract]:
        """What was sent and is not confirmed."""
        return chain(self._writing.values(), (effect for effect, _ in self._wanted.values()))

    def send(self, effects: Iterable[Publish | Retract]) -> None:
        """Want these values at their keys."""
        for effect in effects:
            keyexpr = effect.key.build(effect.address)
            since_s = time.monotonic()
            if put_back := isinstance(effect, PutBack):
                since_s -= max(0.0, time.time() - effect.known_since_s)
            self._wanted[keyexpr] = effect, since_s
            if keyexpr not in self._unwritten:
                self._unwritten.add(keyexpr)
                self._write_soon(keyexpr, first=put_back)

    def _write_soon(self, keyexpr: str, *, first: bool = False, again: bool = False) -> None:
        (self._first if first else self._next).append((keyexpr, again))
        if len(self._writers) < IN_FLIGHT:
            self._writers.add(asyncio.create_task(self._write()))

    def _try_again(self, most: int = 1) -> None:
        """Write some of those that were refused."""
        for _ in range(min(most, len(self._refused))):
            self._write_soon(self._refused.popleft(), again=True)

    def _try_again_later(self) -> None:
        if self._trying is None and self._refused:
            loop = asyncio.get_running_loop()
            self._trying = loop.call_later(REFUSED_AGAIN_S, self._try_again_now)

    def _try_again_now(self) -> None:
        self._trying = None
        self._try_again(IN_FLIGHT)
        self._try_again_later()

    async def written(self, keyexprs: Iterable[str]) -> None:
        """Return when nothing is left to be written at these keys."""
        for keyexpr in keyexprs:
            while keyexpr in self._unwritten:
                loop = asyncio.get_running_loop()
                await asyncio.shield(self._written.setdefault(keyexpr, loop.create_future()))

    async def _write(self) -> None:
        """Write what waits, one key after the other, until nothing does."""
        writer = asyncio.current_task()
        assert writer is not None
        try:
            while waiting := self._first or self._next:
                await self._write_key(*waiting.popleft())
        finally:  # at once: what comes next finds room
            self._writers.remove(writer)

    async def _write_key(self, keyexpr: str, again: bool) -> None:
        """Write what is wanted at a key until nothing is, or it is refused, be it `again`."""
        while (wanted := self._wanted.pop(keyexpr, None)) is not None:
            self._writing[keyexpr] = wanted[0]
            try:
                done = await self._try(keyexpr, *wanted)
            finally:
                del self._writing[keyexpr]
            if not done:
                self._wanted.setdefault(keyexpr, wanted)
                self._refused.append(keyexpr)
                self._try_again_later()
                return
        self._unwritten.discard(keyexpr)
        if (written := self._written.pop(keyexpr, None)) is not None:
            written.set_result(None)
        if again:
            self._try_again()  # there may be room for the next as well

    async def _try(self, keyexpr: str, effect: Publish | Retract, since_s: float) -> bool:
        """Write a key; what did not arrive is wanted again, if nothing newer is. False: it is
        refused, or nobody knows what is wrong with it."""
        try:
            if isinstance(effect, Publish):
                key, address, payload = effect.key, effect.address, effect.payload
                age_s = time.monotonic() - since_s
                await self._session.confirm(key, address, payload, CONFIRM_TIMEOUT_S, age_s=age_s)
            else:
                await self._session.delete(effect.key, effect.address, CONFIRM_TIMEOUT_S)
        except UndecodablePayload as error:
            log.error("not published, since no reader could read it: %s", error)
        except WriteRefused as error:
            log.error("not published, tries again now and then: %s", error)
            return False
        except SchemaError as error:
            if isinstance(error, Overtaken) and effect.key.by_receipt:
                log.info("%s", error)  # which the planner hears, or has heard
            else:
                log.warning("%s", error)
                self._wanted.setdefault(keyexpr, (effect, since_s))
                await asyncio.sleep(_RETRY_S)
        except Exception:
            log.exception("not published, tries again now and then: %s", keyexpr)
            return False
        return True
