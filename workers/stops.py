"""Emergency stops on a robot's side: who is stopped, and a body that then does not move.

A stop is a stored key that each worker follows by itself. It counts from the moment that it
arrives until it is deleted, or releases the robot; the planner has no say in it.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any, TypeVar

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.ids import Id
from keyexpr_schema.keyspace import STOP, STOP_RELEASE
from keyexpr_schema.payloads.motions import Motion, MotionOutcome, MotionState, Senses
from keyexpr_schema.payloads.stops import Stop, holding
from keyexpr_schema.transport.session import Change
from workers.embodiment import Embodiment
from workers.errors import RobotUnreachable
from workers.recovery import DRIVER_S

STOP_KEYS = (STOP, STOP_RELEASE)
"""The keys that `StopBoard.apply` takes changes of."""

_log = logging.getLogger("robotfleet.worker.stops")
_T = TypeVar("_T")


class StopSwitch:
    """Which stops hold one robot still; whoever waits is woken when that changes."""

    def __init__(self) -> None:
        self.standing: tuple[Stop, ...] = ()
        self._changed = asyncio.Event()

    @property
    def reason(self) -> str:
        """Why it is held still, in a sentence."""
        return "; ".join(map(str, self.standing)) or "an emergency stop"

    def set(self, standing: tuple[Stop, ...]) -> None:
        """These hold it now."""
        if standing != self.standing:
            self.standing = standing
            self._changed.set()
            self._changed = asyncio.Event()

    async def changed(self, known: tuple[Stop, ...]) -> tuple[Stop, ...]:
        """What holds it, as soon as that is not `known`."""
        while self.standing == known:
            await self._changed.wait()
        return self.standing

    async def stopped(self) -> None:
        """Wait until something holds it."""
        while not self.standing:
            await self._changed.wait()

    async def released(self) -> None:
        """Wait until nothing holds it."""
        while self.standing:
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
        reason = self._switch.reason
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


async def unless_stopped(work: Coroutine[Any, Any, _T], switch: StopSwitch) -> _T | None:
    """What the work gives; if an emergency stop comes first, it is cancelled: `None`."""
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
    """Bring the robot to rest whenever a stop arrives, and confirm which ones it rests by, for
    ever. Nothing is confirmed before the driver has answered, however long that takes.
    """
    known: tuple[Stop, ...] = ()
    while True:
        known = await switch.changed(known)
        if known:
            _log.warning("%s rests: %s", body.robot, switch.reason)
            await _come_to_rest(body)
        await confirm(tuple(stop.stop for stop in known))


async def _come_to_rest(body: StoppableBody) -> None:
    while True:
        try:
            await body.come_to_rest()
        except (RobotUnreachable, SchemaError) as error:
            _log.error("%s cannot be stopped: %s", body.robot, error)
            await asyncio.sleep(DRIVER_S)
        else:
            return
