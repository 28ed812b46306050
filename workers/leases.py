"""Leases on a robot's side: it moves only while its planner is heard.

A planner gives what a robot was to do to another one after that robot has been away for a while. So
a robot that is cut off, or whose worker is frozen, has to be at rest by then, whatever it can hear.
Its worker asks the planner again and again; a lease counts from when it was *asked* for, on a clock
of the worker's own that nobody sets. So no delay on the way makes it longer (Gray and Cheriton,
"Leases: an efficient fault-tolerant mechanism for distributed file cache consistency", 1989).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.keyspace import LEASE
from keyexpr_schema.payloads.leases import LeaseQuery
from keyexpr_schema.payloads.system import PlannerAddress
from keyexpr_schema.payloads.tasks import Order
from keyexpr_schema.payloads.waits import WaitKind, WaitReason
from keyexpr_schema.transport.session import Session
from workers.host_clock import running_s
from workers.stops import StopSwitch

RENEWALS = 4
"""How often a lease is asked for within its length, so that a question may be lost."""
LEAST_LENGTH_S = 1.0
"""A lease is taken for no shorter one [s]."""
TOLD_S = 2.0
"""A robot that has had no lease for so long says that it waits for one [s]; each order waits for
its first one for a moment."""
LEAST_PAUSE_S = 0.05
"""Between two questions, when they fail at once."""


@dataclass
class _Lease:
    order: Order
    incarnation: str
    length_s: float
    switch: StopSwitch


class Leases:
    """The leases of all robots of a process: one question for all of them.

    Nothing is asked while no robot needs one.
    """

    def __init__(self, session: Session, now_s: Callable[[], float] = running_s) -> None:
        self._session, self._now_s = session, now_s
        self._needed: dict[str, _Lease] = {}
        self._more = asyncio.Event()

    @contextmanager
    def needed(self, order: Order, incarnation: str, switch: StopSwitch) -> Iterator[None]:
        """Within the block `switch` holds the robot still unless a lease is valid.

        The order says how long one is; 0: it needs none. One that is over before it can be asked
        for would hold the robot, and all its orders, for good.
        """
        robot, length_s = order.robot, order.lease_s
        if length_s <= 0.0:
            yield
            return
        self._needed[robot] = _Lease(order, incarnation, max(LEAST_LENGTH_S, length_s), switch)
        switch.lease_until(self._now_s())
        self._more.set()
        try:
            yield
        finally:
            del self._needed[robot]
            switch.lease_until(None)

    def waits_of(self, robot: str) -> tuple[WaitReason, ...]:
        """That a robot has had no lease for a while, as what its order waits for."""
        lease = self._needed.get(robot)
        if lease is None or lease.switch.lease_left_s() > -TOLD_S:
            return ()
        order = lease.order
        return (WaitReason(kind=WaitKind.LEASE, robot=robot, plan=order.plan, task=order.task),)

    async def run(self) -> None:
        """Ask for ever; ends by being cancelled."""
        while True:
            self._more.clear()
            if not self._needed:
                await self._more.wait()
            asked_s = self._now_s()
            await self._ask(asked_s)
            pause_s = max(LEAST_PAUSE_S, asked_s + self._interval_s() - self._now_s())
            try:
                async with asyncio.timeout(min(pause_s, self._left_s())):
                    await self._more.wait()
            except TimeoutError:
                pass
            self._look()

    async def _ask(self, asked_s: float) -> None:
        asking = dict(self._needed)
        query = LeaseQuery(robots={robot: lease.incarnation for robot, lease in asking.items()})
        timeout_s = min(self._interval_s(), self._left_s())
        try:
            grant = await self._session.query(LEASE, PlannerAddress(), query, timeout_s)
        except SchemaError:
            return
        for robot, length_s in grant.granted.items():
            if robot in asking and self._needed.get(robot) is asking[robot]:
                length_s = min(length_s, asking[robot].length_s)
                asking[robot].switch.lease_until(asked_s + length_s)

    def _look(self) -> None:
        for lease in self._needed.values():
            lease.switch.look()

    def _interval_s(self) -> float:
        return min((lease.length_s for lease in self._needed.values()), default=1.0) / RENEWALS

    def _left_s(self) -> float:
        """Until the next of them runs out, so that it is seen at once."""
        left_s = (lease.switch.lease_left_s() for lease in self._needed.values())
        return max(LEAST_PAUSE_S, min((left for left in left_s if left > 0.0), default=1.0))
