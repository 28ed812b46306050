"""What holds a robot still, on its own side: emergency stops, and a lease that has run out.

A stop is a stored key that each worker follows by itself. It counts from the moment that it
arrives until it is deleted, or releases the robot; the planner has no say in it. Leases are in
`workers.leases`.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.ids import Id
from keyexpr_schema.keyspace import STOP, STOP_RELEASE
from keyexpr_schema.payloads.motions import Motion, MotionOutcome, MotionState, Senses
from keyexpr_schema.payloads.stops import Stop, holding
from keyexpr_schema.transport.session import Change
from workers.embodiment import Embodiment, YieldingEmbodiment
from workers.errors import RobotUnreachable
from workers.host_clock import running_s
from workers.recovery import DRIVER_S

STOP_KEYS = (STOP, STOP_RELEASE)
"""The keys that `StopBoard.apply` takes changes of."""

_log = logging.getLogger("robotfleet.worker.stops")
_T = TypeVar("_T")


@dataclass(frozen=True)
class Held:
    """What holds a robot still: emergency stops, or that its lease has `lapsed`."""

    stops: tuple[Stop, ...] = ()
    lapsed: bool = False

    def __bool__(self) -> bool:
        return self.lapsed or bool(self.stops)

    def __str__(self) -> str:
        lapsed = ("the planner was not heard of for the length of its lease",)
        return "; ".join((*map(str, self.stops), *(lapsed if self.lapsed else ())))


class StopSwitch:
    """What holds one robot still; whoever waits is woken when that changes."""

    def __init__(self, now_s: Callable[[], float] = running_s) -> None:
        self._now_s = now_s
        self._held = Held()
        self.latest = Held(lapsed=True)
        """What held it last, or holds it."""
        self.had_lease = True
        """Whether what was said last of its lease let it move."""
        self._lease_until_s: float | None = None
        self._changed = asyncio.Event()

    @property
    def held(self) -> Held:
        """What holds it at this moment, by the clock."""
        self.look()
        return self._held

    @property
    def standing(self) -> tuple[Stop, ...]:
        """The emergency stops that hold it."""
        return self._held.stops

    def set(self, standing: tuple[Stop, ...]) -> None:
        """These stops hold it now."""
        self._become(replace(self._held, stops=standing))

    def lease_until(self, until_s: float | None) -> None:
        """It may move until then, on the clock of `running_s`, and no longer; `None`: it needs no
        lease."""
        self._lease_until_s = until_s
        self.had_lease = self.lease_left_s() > 0.0
        self.look()

    def lease_left_s(self) -> float:
        """How long its lease is valid yet [s]; below 0 it has run out."""
        return math.inf if self._lease_until_s is None else self._lease_until_s - self._now_s()

    def look(self) -> None:
        """Look at the clock: who waits for it is woken where a lease has run out."""
        self._become(replace(self._held, lapsed=self.lease_left_s() <= 0.0))

    def _become(self, held: Held) -> None:
        if held != self._held:
            self._held = held
            self.latest = held or self.latest
            self._changed.set()
            self._changed = asyncio.Event()

    async def changed(self, known: Held) -> Held:
        """What holds it, as soon as that is not `known`."""
        while self.held == known:
            await self._changed.wait()
        return self._held

    async def stopped(self) -> None:
        """Wait until something holds it."""
        while not self.held:
            await self._changed.wait()

    async def released(self) -> None:
        """Wait until nothing holds it."""
        while self.held:
            await self._changed.wait()


class StopBoard:
    """The stops of a realm, kept up to date by `apply`, and a switch for each robot."""

    def __init__(self) -> None:
        self._switches: dict[str, StopSwitch] = {}
        self._stops: dict[str, Stop] = {}
        self._released: set[tuple[str, str]] = set()

    def switch(self, robot: str) -> StopSwitch:
        """What holds one robot still."""
        if robot not in self._switches:
            self._switches[robot] = StopSwitch()
            self._switches[robot].set(holding(robot, self._stops, self._released))
        return self._switches[robot]

    def apply(self, change: Change[Any, Any]) -> None:
        """Take over one change of one of `STOP_KEYS`."""
        address, value = change.address, change.value
        if change.key is STOP_RELEASE:
            pair = (address.stop, address.robot)
            (self._released.discard if value is None else self._released.add)(pair)
        elif value is None:
            self._stops.pop(address.stop, None)
        else:
            self._stops[address.stop] = value
        for robot, switch in self._switches.items():
            switch.set(holding(robot, self._stops, self._released))


class StoppableBody:
    """An embodiment that begins no motion while its robot is stopped, and ends the one that runs.

    A motion that is asked for then waits until the robot is released. `stop` and `senses` are
    always passed on. It is an `Embodiment` itself.
    """

    def __init__(self, body: Embodiment, switch: StopSwitch) -> None:
        self._body, self._switch = body, switch
        self._moving = 0
        self._rests = asyncio.Event()
        self._rests.set()

    @property
    def robot(self) -> str:
        """The robot's id."""
        return self._body.robot

    def now_s(self) -> float:
        """Seconds on the fleet's clock."""
        return self._body.now_s()

    async def senses(self) -> Senses:
        """What the robot knows of itself; see `Embodiment.senses`."""
        return await self._body.senses()

    async def stop(self) -> None:
        """Bring the robot to rest; see `Embodiment.stop`."""
        await self._body.stop()

    async def perform(self, motion: Motion) -> MotionOutcome:
        """Carry out `motion`; `STOPPED` if an emergency stop came meanwhile."""
        await self._switch.released()
        self._moving += 1
        self._rests.clear()
        try:
            outcome = await unless_stopped(self._body.perform(motion), self._switch)
        finally:
            self._moving -= 1
            if not self._moving:
                self._rests.set()
        if outcome is not None:
            return outcome
        reason = str(self._switch.latest)
        return MotionOutcome(
            state=MotionState.STOPPED, senses=await self._body.senses(), reason=reason
        )

    async def come_to_rest(self) -> None:
        """Bring the robot to rest, whatever it is doing; returns when nothing moves any more.

        Raises:
            RobotUnreachable: the driver does not answer.
        """
        await self._body.stop()
        await self._rests.wait()

    async def release(self) -> None:
        """It may make way for others again, unless it is stopped meanwhile."""
        if isinstance(self._body, YieldingEmbodiment):
            with suppress(RobotUnreachable, SchemaError):
                await unless_stopped(self._body.release(), self._switch)


async def unless_stopped(work: Coroutine[Any, Any, _T], switch: StopSwitch) -> _T | None:
    """What the work gives; if the robot is held still before, it is cancelled: `None`."""
    working = asyncio.ensure_future(work)
    stopped = asyncio.ensure_future(switch.stopped())
    try:
        await asyncio.wait({working, stopped}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        stopped.cancel()
        working.cancel()  # does nothing to what has ended
        await asyncio.wait({working, stopped})
    return None if working.cancelled() else working.result()


async def released_unless(cancelled: asyncio.Event, switch: StopSwitch) -> bool:
    """Wait until the robot is released, or `cancelled` is set; whether it is released."""
    cancel = asyncio.ensure_future(cancelled.wait())
    release = asyncio.ensure_future(switch.released())
    try:
        await asyncio.wait({cancel, release}, return_when=asyncio.FIRST_COMPLETED)
        return release.done()
    finally:
        cancel.cancel()
        release.cancel()


async def obey_stops(
    switch: StopSwitch, body: StoppableBody, confirm: Callable[[tuple[Id, ...]], Awaitable[None]]
) -> None:
    """Bring the robot to rest whenever a stop arrives or its lease runs out, and confirm which
    stops it rests by, for ever. Nothing is confirmed before the driver has answered, however long
    that takes.
    """
    known = Held()
    while True:
        known = await switch.changed(known)
        if known:
            if known.stops or switch.had_lease:  # each order waits for its first lease, and rests
                _log.warning("%s rests: %s", body.robot, known)
            if not await _come_to_rest(body, switch):
                continue
        await confirm(tuple(stop.stop for stop in known.stops))
        if not known:
            await body.release()


async def _come_to_rest(body: StoppableBody, switch: StopSwitch) -> bool:
    """Whether it rests; not, where nothing holds it any more before it does: what it has begun
    since then goes on."""
    while True:
        try:
            await body.come_to_rest()
        except (RobotUnreachable, SchemaError) as error:
            if not switch.held:
                return False
            _log.error("%s cannot be stopped: %s", body.robot, error)
            await asyncio.sleep(DRIVER_S)
            if not switch.held:
                return False
        else:
            return True
