"""`SharedWatch`: what all robots of a process follow, watched once for all of them."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager

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
    runs; and their `leases`, asked for in one question.

    One subscription and one listing for all: what a robot more costs is its own orders.
    """

    def __init__(self, session: Session, *robots: str) -> None:
        self.world = WorldCache()
        self._session = session
        self._orders: dict[str, dict[OrderAddress, Order]] = {robot: {} for robot in robots}
        self._arrivals: dict[str, Arrivals] = {}
        self._stops = StopBoard(robots)
        self.leases = Leases(session)
        self._synced = asyncio.Event()

    def stops(self, robot: str) -> StopSwitch:
        """What holds one of the robots still."""
        return self._stops.switches[robot]

    async def run(self) -> None:
        """Follow for ever; ends by being cancelled."""
        own: list[dict[str, str | int]] = [{"robot": robot} for robot in self._orders]
        orders = ((ORDER, fixed) for fixed in own)
        async with self._session.watch(*STOP_KEYS, *WORLD_KEYS, *orders) as watch:
            noting = asyncio.create_task(self._note_synced(watch))
            asking = asyncio.create_task(self.leases.run())
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
                asking.cancel()

    async def synced(self) -> None:
        """Wait until all that was there at the start has been taken in."""
        await self._synced.wait()

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

    async def _note_synced(self, watch: Watch) -> None:
        await watch.synced()
        # The loop above takes in all that was handed over without a pause, and woke up before us.
        await asyncio.sleep(0)
        self._synced.set()
