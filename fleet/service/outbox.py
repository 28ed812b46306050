"""Publishes what the core wants published, each key in turn, until the store has confirmed it."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Iterable, Iterator
from contextlib import asynccontextmanager
from itertools import chain

from fleet.core.effects import Publish, Retract
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
        self._busy: dict[str, asyncio.Task[None]] = {}
        """Keys that are being written, or are about to be."""
        self._writing: dict[str, Publish | Retract] = {}
        self._room = asyncio.Semaphore(IN_FLIGHT)

    @asynccontextmanager
    async def running(self) -> AsyncIterator[Outbox]:
        """Write until the block ends; what was not written by then is left to the next start."""
        try:
            yield self
        finally:
            tasks = list(self._busy.values())
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    @property
    def unconfirmed(self) -> Iterator[Publish | Retract]:
        """What was sent and is not confirmed."""
        return chain(self._writing.values(), (effect for effect, _ in self._wanted.values()))

    def send(self, effects: Iterable[Publish | Retract]) -> None:
        """Want these values at their keys."""
        for effect in effects:
            keyexpr = effect.key.build(effect.address)
            self._wanted[keyexpr] = effect, time.monotonic()
            if keyexpr not in self._busy:
                self._busy[keyexpr] = asyncio.create_task(self._write(keyexpr))

    async def written(self, keyexprs: Iterable[str]) -> None:
        """Return when nothing is left to be written at these keys."""
        for keyexpr in keyexprs:
            while (task := self._busy.get(keyexpr)) is not None:
                await asyncio.shield(task)

    async def _write(self, keyexpr: str) -> None:
        async with self._room:
            while (wanted := self._wanted.pop(keyexpr, None)) is not None:
                effect, since_s = wanted
                self._writing[keyexpr] = effect
                try:
                    if isinstance(effect, Publish):
                        key, address, payload = effect.key, effect.address, effect.payload
                        age_s = time.monotonic() - since_s
                        await self._session.confirm(
                            key, address, payload, CONFIRM_TIMEOUT_S, age_s=age_s
                        )
                    else:
                        await self._session.delete(effect.key, effect.address, CONFIRM_TIMEOUT_S)
                except UndecodablePayload as error:
                    log.error("not published, since no reader could read it: %s", error)
                except WriteRefused as error:
                    log.error("not published, tries again now and then: %s", error)
                    self._wanted.setdefault(keyexpr, wanted)
                    await asyncio.sleep(REFUSED_AGAIN_S)
                except SchemaError as error:
                    if isinstance(error, Overtaken) and effect.key.by_receipt:
                        log.info("%s", error)  # which the planner hears, or has heard
                    else:
                        log.warning("%s", error)
                        self._wanted.setdefault(keyexpr, wanted)
                        await asyncio.sleep(_RETRY_S)
                del self._writing[keyexpr]
        del self._busy[keyexpr]
