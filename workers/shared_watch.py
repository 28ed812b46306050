"""`SharedWatch`: what all robots of a process follow, watched once for all of them."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import ORDER
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.tasks import Order, OrderAddress
from keyexpr_schema.transport.session import Session, Watch
from workers.leases import Leases
from workers.stops import STOP_KEYS, StopBoard, StopSwitch
from workers.world_cache import WORLD_KEYS, WorldCache

Arrivals = asyncio.Queue[tuple[OrderAddress, Order | None]]
"""What comes to stand on the keys of a robot's orders, in order; `None`: nothing any more."""


class SharedWatch:
    """The world, the orders of each of `robots`, and who is stopped, kept up to date while `run`
    runs, with their `leases`, asked for in one question; the orders of others while `follow` does.

    One subscription and one listing for all: what a robot more costs is its own orders.
    """

    def __init__(self, session: Session, *robots: str) -> None:
        self.world = WorldCache()
        self._session = session
        self._orders: dict[str, dict[OrderAddress, Order]] = {}
        self._arrivals: dict[str, Arrivals] = {}
        self._stops = StopBoard()
        self.leases = Leases(session)
        self._synced = asyncio.Event()
        self._orders_synced: dict[str, asyncio.Event] = {}
        self._robots = robots
        self._expect(robots, self._synced)

    def stops(self, robot: str) -> StopSwitch:
        """What holds one of the robots still."""
        return self._stops.switch(robot)

    async def run(self) -> None:
        """Follow for ever; ends by being cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self.leases.run())
            await self._watch((*STOP_KEYS, *WORLD_KEYS), self._robots, self._synced)

    async def follow(self, *robots: str) -> None:
        """Follow the orders of more robots, for ever; ends by being cancelled."""
        synced = asyncio.Event()
        self._expect(robots, synced)
        await self._watch((), robots, synced)

    def _expect(self, robots: Iterable[str], synced: asyncio.Event) -> None:
        for robot in robots:
            self._orders[robot], self._orders_synced[robot] = {}, synced

    async def _watch(
        self, keys: Iterable[Key[Any, Any]], robots: Iterable[str], synced: asyncio.Event
    ) -> None:
        own: list[dict[str, str | int]] = [{"robot": robot} for robot in robots]
        orders = ((ORDER, fixed) for fixed in own)
        async with self._session.watch(*keys, *orders) as watch:
            noting = asyncio.create_task(_note_synced(watch, synced))
            try:
                async for change in watch:
                    if change.key is ORDER:
                        self._pass_on(change.address, change.value)
                    elif change.key in STOP_KEYS:
                        self._stops.apply(change)
                    else:
                        self.world.apply(change)
            finally:
                noting.cancel()

    async def synced(self, robot: str | None = None) -> None:
        """Wait until all that was there at the start has been taken in, of the orders those of
        `robot`."""
        await self._synced.wait()
        if robot is not None:
            await self._orders_synced[robot].wait()

    async def registered(self, robot: str) -> RobotSpec:
        """The robot's spec, as soon as somebody has registered it."""
        await self.world.until(lambda: robot in self.world.specs)
        return self.world.specs[robot]

    @contextmanager
    def orders(self, robot: str) -> Iterator[Arrivals]:
        """The orders of one of the robots: those that stand, then what changes."""
        arrivals: Arrivals = asyncio.Queue()
        for address, order in self._orders[robot].items():
            arrivals.put_nowait((address, order))
        self._arrivals[robot] = arrivals
        try:
            yield arrivals
        finally:
            del self._arrivals[robot]

    def _pass_on(self, address: OrderAddress, order: Order | None) -> None:
        standing = self._orders[address.robot]
        if order is None:
            standing.pop(address, None)
        else:
            standing[address] = order
        if (arrivals := self._arrivals.get(address.robot)) is not None:
            arrivals.put_nowait((address, order))


async def _note_synced(watch: Watch, synced: asyncio.Event) -> None:
    await watch.synced()
    # The loop that reads takes in all that was handed over without a pause, and woke up before us.
    await asyncio.sleep(0)
    synced.set()
