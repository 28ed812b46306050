"""A robot has one worker: two would each carry out every order.

One journal cannot be open twice, but a second worker may be started with another data folder, or on
another host. Who starts gives way to a worker that is connected. Two that start at one instant, or
that come to see each other when a network heals, do not know which was first: the one whose
incarnation comes first in order stays, and serves once the other is gone.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress

from keyexpr_schema.keyspace import ROBOT_ALIVE
from keyexpr_schema.payloads.robots import AliveAddress
from keyexpr_schema.transport.session import Session, TokenWatch
from workers.errors import RobotTaken

GONE_S = 4.0
"""How long the token of a worker that is dead can stay [s]: its lease of 2 s, and as much again."""
SETTLED_S = 60.0
"""How long one that stays waits for those that give way to end [s]: on a busy host that takes
a while, and if it gave up, nobody would be left."""


class OnlyWorker:
    """Sees to it that a run of a worker is the only one of its robot."""

    def __init__(self, session: Session, robot: str, incarnation: str) -> None:
        self._session = session
        self._own = AliveAddress(robot, incarnation)

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[OnlyWorker]:
        """Be seen as the robot's worker, until the block ends.

        Raises:
            RobotTaken: another one is connected, and was before.
        """
        async with self._watched() as self._watch:
            await self._watch.synced()
            await self._until_alone(self._watch, GONE_S)
            async with self._session.token(ROBOT_ALIVE, self._own):
                yield self

    async def settled(self) -> None:
        """Wait until those that started at the same instant have given way.

        Raises:
            RobotTaken: this one has to, or they do not.
        """
        async with self._watched() as seen:  # looks anew: of two, the later one sees the other
            await seen.synced()
            self._give_way(seen)
            await self._until_alone(seen, SETTLED_S)

    async def give_way(self) -> None:
        """Watch for ever.

        Raises:
            RobotTaken: a worker has come to be there that this one gives way to.
        """
        while True:
            self._give_way(self._watch)
            await anext(self._watch)

    def _watched(self) -> AbstractAsyncContextManager[TokenWatch[AliveAddress]]:
        return self._session.watch_tokens(ROBOT_ALIVE, robot=self._own.robot)

    def _others(self, watch: TokenWatch[AliveAddress]) -> list[str]:
        return sorted(seen.incarnation for seen in watch.alive - {self._own})

    async def _until_alone(self, watch: TokenWatch[AliveAddress], limit_s: float) -> None:
        """Until the others are gone: one that was killed just now soon is."""
        with suppress(TimeoutError):
            async with asyncio.timeout(limit_s):
                while self._others(watch):
                    await anext(watch)
        if others := self._others(watch):
            raise self._taken(others)

    def _give_way(self, watch: TokenWatch[AliveAddress]) -> None:
        if first := [other for other in self._others(watch) if other < self._own.incarnation]:
            raise self._taken(first)

    def _taken(self, others: list[str]) -> RobotTaken:
        return RobotTaken(
            f"a worker of {self._own.robot} is connected already ({', '.join(others)}): two would "
            "both carry out each order; stop that one first"
        )
