"""How long a lease is valid: by the worker's own clock, from when it was asked for."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from keyexpr_schema.errors import NoReply
from keyexpr_schema.payloads.leases import LeaseGrant, LeaseQuery
from keyexpr_schema.payloads.tasks import Order
from keyexpr_schema.payloads.waits import WaitKind, WaitReason
from tests.support.polling import DEADLINE_S
from workers.leases import TOLD_S, Leases
from workers.stops import Held, StopSwitch

LENGTH_S = 8.0


class Wire:
    """A planner that answers `given`, after `delay_s` on the clock of the test; and that clock."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        self.delay_s = 0.0
        self.given: dict[str, float] | None = None
        self.asked: asyncio.Queue[LeaseQuery] = asyncio.Queue()

    async def query(self, _key: Any, _address: Any, asked: LeaseQuery, _timeout_s: float) -> Any:
        """As `Session.query`."""
        self.now_s += self.delay_s
        self.asked.put_nowait(asked)
        if self.given is None:
            raise NoReply("nobody serves it")
        return LeaseGrant(granted=self.given)

    async def answered(self) -> LeaseQuery:
        """Wait for the next question, and until its answer has been taken in."""
        async with asyncio.timeout(DEADLINE_S):
            asked = await self.asked.get()
            next_one = await self.asked.get()
        assert next_one.robots.keys() >= set()
        return asked


def order(robot: str, lease_s: float) -> Order:
    return Order(
        robot=robot,
        plan="p",
        revision=1,
        task="t1",
        attempt=1,
        epoch=1,
        skill="navigate",
        args={},
        deadline_s=60.0,
        lease_s=lease_s,
    )


@contextmanager
def asking(wire: Wire) -> Iterator[Leases]:
    """Leases that are asked for in the background."""
    leases = Leases(wire, lambda: wire.now_s)  # type: ignore[arg-type]
    running = asyncio.ensure_future(leases.run())
    try:
        yield leases
    finally:
        running.cancel()


async def test_a_lease_counts_from_when_it_was_asked_for() -> None:
    wire = Wire()
    switch = StopSwitch(lambda: wire.now_s)
    wire.given = {"r1": LENGTH_S}
    with asking(wire) as leases, leases.needed(order("r1", LENGTH_S), "run-1", switch):
        assert switch.held == Held(lapsed=True)
        assert (await wire.answered()).robots == {"r1": "run-1"}
        assert not switch.held
        wire.now_s += LENGTH_S - 0.001
        assert not switch.held
        wire.now_s += 0.001
        assert switch.held  # whatever else waits for its turn, as after a sleep of the host
        wire.delay_s = LENGTH_S  # an answer that took as long gives nothing
        for _ in range(3):
            await wire.answered()
            assert switch.held
        wire.delay_s = 0.0
        await asyncio.wait_for(switch.released(), DEADLINE_S)


async def test_no_answer_and_no_grant_give_nothing_and_too_long_a_grant_is_cut() -> None:
    wire = Wire()
    switch = StopSwitch(lambda: wire.now_s)
    with asking(wire) as leases, leases.needed(order("r1", LENGTH_S), "run-1", switch):
        await wire.answered()
        assert switch.held and leases.waits_of("r1") == (), "each order waits for a moment"
        wire.given = {"r2": LENGTH_S}
        await wire.answered()
        wire.now_s += TOLD_S
        waits = WaitReason(kind=WaitKind.LEASE, robot="r1", plan="p", task="t1")
        assert switch.held and leases.waits_of("r1") == (waits,)
        wire.given = {"r1": 3600.0}
        await asyncio.wait_for(switch.released(), DEADLINE_S)
        assert switch.lease_left_s() <= LENGTH_S and leases.waits_of("r1") == ()
    assert leases.waits_of("r1") == ()


async def test_without_an_order_that_needs_one_nothing_is_asked() -> None:
    wire = Wire()
    switch = StopSwitch(lambda: wire.now_s)
    with asking(wire) as leases:
        with leases.needed(order("r1", 0.0), "run-1", switch):
            assert not switch.held
        with leases.needed(order("r2", LENGTH_S), "run-2", StopSwitch(lambda: wire.now_s)):
            assert set((await wire.answered()).robots) == {"r2"}
        assert not switch.held


async def test_a_lease_that_is_over_before_it_can_be_asked_for_holds_nobody_for_good() -> None:
    wire = Wire()
    switch = StopSwitch(lambda: wire.now_s)
    wire.given = {"r1": LENGTH_S}
    wire.delay_s = 0.1
    with asking(wire) as leases, leases.needed(order("r1", 1e-9), "run-1", switch):
        await asyncio.wait_for(switch.released(), DEADLINE_S)
        wire.now_s += LENGTH_S
        assert switch.held
