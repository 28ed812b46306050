"""A robot has one worker, and a realm one simulated world: two would each carry out every order.

One journal cannot be open twice, but a second worker may be started with another data folder, or on
another host. Who starts gives way to one that is connected. Two that start at one instant, or that
come to see each other when a network heals, do not know which was first: the one whose incarnation
comes first in order stays, and serves once the other is gone.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from typing import Any, Generic, TypeVar

from keyexpr_schema.key import Address, Key
from keyexpr_schema.transport.session import Session, TokenWatch

A = TypeVar("A", bound=Address)

GONE_S = 4.0
"""How long the token of a run that is dead can stay [s]: its lease of 2 s, and as much again."""
SETTLED_S = 60.0
"""How long one that stays waits for those that give way to end [s]: on a busy host that takes
a while, and if it gave up, nobody would be left."""


class OnlyRun(Generic[A]):
    """Sees to it that a run is the only one of its kind.

    `own` is where its token stands, under `key`; other runs have theirs beside it, with other
    incarnations, the last chunk of their keys. `fixed` is what they share. `taken` makes the
    exception that is raised where other incarnations are in the way.
    """

    def __init__(
        self,
        session: Session,
        key: Key[A, Any],
        own: A,
        taken: Callable[[str], Exception],
        **fixed: str,
    ) -> None:
        self._session, self._key, self._own, self._fixed = session, key, own, fixed
        self._taken = taken

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[OnlyRun[A]]:
        """Be seen, until the block ends.

        Raises:
            Exception: that of `taken`: another one is connected, and was before.
        """
        async with self._watched() as self._watch:
            await self._watch.synced()
            await self._until_alone(self._watch, GONE_S)
            async with self._session.token(self._key, self._own):
                yield self

    async def settled(self) -> None:
        """Wait until those that started at the same instant have given way.

        Raises:
            Exception: that of `taken`: this one has to, or they do not.
        """
        async with self._watched() as seen:  # looks anew: of two, the later one sees the other
            await seen.synced()
            await seen.certain()  # a new watch is now and then shown one that is gone
            self._give_way(seen)
            await self._until_alone(seen, SETTLED_S)

    async def give_way(self) -> None:
        """Watch for ever.

        Raises:
            Exception: that of `taken`: one has come to be there that this one gives way to.
        """
        while True:
            await self._watch.certain()
            self._give_way(self._watch)
            await anext(self._watch)

    def _watched(self) -> AbstractAsyncContextManager[TokenWatch[A]]:
        return self._session.watch_tokens(self._key, 0.5, **self._fixed)

    def _incarnation(self, address: A) -> str:
        return str(self._key.build(address)).rpartition("/")[2]

    def _others(self, watch: TokenWatch[A]) -> list[str]:
        return sorted(self._incarnation(seen) for seen in watch.alive - {self._own})

    async def _until_alone(self, watch: TokenWatch[A], limit_s: float) -> None:
        """Until the others are gone: one that was killed just now soon is."""
        with suppress(TimeoutError):
            async with asyncio.timeout(limit_s):
                while self._others(watch):
                    await anext(watch)
        if others := self._others(watch):
            raise self._taken(", ".join(others))

    def _give_way(self, watch: TokenWatch[A]) -> None:
        own = self._incarnation(self._own)
        if first := [other for other in self._others(watch) if other < own]:
            raise self._taken(", ".join(first))
