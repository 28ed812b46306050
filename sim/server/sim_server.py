"""Joins a simulated world to keys: answers motion calls, lets time run, publishes what happens.

Everything runs on one asyncio loop, the world included: it goes on for a few milliseconds at a
time, and in between calls are answered. So nothing else ever touches the backend, and no lock is
needed; a control period of the physics (1 to 3 ms) is the longest that a call waits.
"""

from __future__ import annotations

import asyncio

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.keyspace import CLOSURE, SIM_MOTION
from keyexpr_schema.payloads.motions import MotionOutcome
from keyexpr_schema.payloads.simulation import MotionCall, SimRobotAddress
from keyexpr_schema.transport.session import Session, Watch
from sim.backend import Backend
from sim.server.closed_ways import ClosedWays
from sim.server.motion_calls import MotionCalls
from sim.server.publisher import WorldPublisher
from sim.server.wait_budget import WaitBudget
from workers.stops import STOP_KEYS, StopBoard

CHUNK_S = 0.004
"""Wall time for which the world goes on before calls are looked at."""

PACE_S, IDLE_S = 0.005, 0.05
"""How often a world looks around that has a pace, and one that waits for calls."""

LAG_S = 0.5
"""A world that is further behind the wall clock stops trying to catch up."""

REST_S = 10.0
"""Simulated time for which what rolls keeps a world going in which no robot moves."""
ROLLING_S = 0.05
"""How often it is looked whether it still rolls, simulated."""

GRACE_S = 0.25
WATCHDOG_S = 2.0
UNLINKED_S = 4.0
"""How long our own link to the router may be down before that counts as the workers' silence."""


class SimServer:
    """One simulated world, served.

    `speed` is simulated seconds a second of wall time. `None` is as fast as it goes: then time
    advances only while some robot moves, or something has not come to rest yet, for `REST_S` at
    most: a ball that a robot has let go of rolls on. After a motion has ended it waits up to
    `grace_s` of wall time for that robot's next call, so that the thinking of workers and planners
    takes no simulated time; with many robots, as far as that can be afforded (`WaitBudget`).

    A motion that nobody has asked about for `watchdog_s` (beyond the wait of the last call) is
    stopped, as a driver would stop a robot whose worker is gone. While our own link to the router
    is down, that clock stands still for `unlinked_s`: a router that is started again is no worker
    who is away. After that it may be we who are cut off, and nobody could stop the robot.
    """

    def __init__(
        self,
        session: Session,
        backend: Backend,
        speed: float | None = 1.0,
        grace_s: float = GRACE_S,
        watchdog_s: float = WATCHDOG_S,
        unlinked_s: float = UNLINKED_S,
    ) -> None:
        self._session, self._backend = session, backend
        self._speed, self._grace_s, self._watchdog_s = speed, grace_s, watchdog_s
        self._unlinked_s = unlinked_s
        self._stops = StopBoard()
        self._calls = {
            robot: MotionCalls(backend, robot, self._stops.switch(robot))
            for robot in backend.robots
        }
        self._closed = ClosedWays(backend)
        self._publisher = WorldPublisher(session, backend, speed)
        self._called = asyncio.Event()
        self._budget = WaitBudget()
        self._ready = asyncio.Event()
        self._moved_s = backend.time_s
        self._linked_s = 0.0

    async def ready(self) -> None:
        """Wait until calls are answered."""
        await self._ready.wait()

    async def run(self) -> None:
        """Serve until cancelled."""
        async with (
            self._session.watch(*STOP_KEYS) as stops,
            self._session.watch(CLOSURE) as closures,
        ):
            others = [
                asyncio.create_task(self._obey(stops)),
                asyncio.create_task(self._closed.follow(closures)),
            ]
            try:
                await stops.synced()
                await closures.synced()
                async with self._session.serve(SIM_MOTION, self._answer):
                    others.append(asyncio.create_task(self._publisher.keep_scene()))
                    self._ready.set()
                    await self._run_world()
            finally:
                for other in others:
                    other.cancel()
                await asyncio.gather(*others, return_exceptions=True)

    async def _obey(self, stops: Watch) -> None:
        """Emergency stops hold for simulated drivers as for workers, who may be dead."""
        async for change in stops:
            self._stops.apply(change)
            for calls in self._calls.values():
                calls.obey_stops()

    async def _answer(self, address: SimRobotAddress, call: MotionCall) -> MotionOutcome:
        calls = self._calls.get(address.robot)
        if calls is None:
            raise SchemaError(
                f"there is no robot {address.robot!r} in this world; "
                f"there are {', '.join(self._calls)}"
            )
        self._called.set()
        return await calls.answer(call, asyncio.get_running_loop())

    async def _run_world(self) -> None:
        loop = asyncio.get_running_loop()
        base_wall_s, base_s = loop.time(), self._backend.time_s
        while True:
            wall_s = loop.time()
            speed = self._speed_now(wall_s)
            if speed is None:
                base_wall_s, base_s = wall_s, self._backend.time_s
                moving = self._anybody_moves()
                until_s = None if moving else self._backend.time_s + ROLLING_S
                await self._advance_until(loop, until_s)
                continue
            due_s = base_s + (wall_s - base_wall_s) * speed
            if speed == 0.0 or due_s - self._backend.time_s > LAG_S * speed:
                base_wall_s, base_s = wall_s, self._backend.time_s
                due_s = base_s
            if speed > 0.0:
                await self._advance_until(loop, max(due_s, self._backend.time_s))
            self._poll_motions(loop.time())
            self._called.clear()
            paused_s = loop.time()
            held_s = self._held_s(paused_s)
            active = sum(calls.active for calls in self._calls.values())
            thinking = sum(calls.holds(paused_s) for calls in self._calls.values())
            if speed == 0.0 and active and not held_s:
                continue
            pause_s = PACE_S if speed > 0.0 else max(PACE_S, min(held_s or IDLE_S, IDLE_S))
            try:
                async with asyncio.timeout(pause_s):
                    await self._called.wait()
            except TimeoutError:
                pass
            if held_s:
                self._budget.spend(loop.time() - paused_s, active, thinking)

    def _speed_now(self, wall_s: float) -> float | None:
        if self._speed is not None:
            return self._speed
        if self._held_s(wall_s):
            return 0.0
        if self._anybody_moves():
            self._moved_s = self._backend.time_s
            return None
        rolling = self._backend.time_s - self._moved_s < REST_S and not self._backend.at_rest()
        return None if rolling else 0.0

    def _anybody_moves(self) -> bool:
        return any(calls.active for calls in self._calls.values())

    def _held_s(self, wall_s: float) -> float:
        """How long the world waits at most for the next calls of robots whose motions just ended.

        A call wakes it up earlier.
        """
        if self._speed is not None or self._budget.left_s <= 0.0:
            return 0.0
        until_s = (c.held_until_s for c in self._calls.values() if c.holds(wall_s))
        return max(0.0, min(max(until_s, default=0.0) - wall_s, self._budget.left_s))

    async def _advance_until(self, loop: asyncio.AbstractEventLoop, until_s: float | None) -> None:
        """Let the world go on for a few milliseconds, at most to `until_s`."""
        began_wall_s = loop.time()
        end_wall_s = began_wall_s + CHUNK_S
        while until_s is None or self._backend.time_s < until_s:
            self._backend.advance()
            self._closed.look_at_clock()
            if self._poll_motions(loop.time()) or loop.time() >= end_wall_s:
                break
        self._budget.earn(loop.time() - began_wall_s)
        await asyncio.sleep(0)

    def _poll_motions(self, wall_s: float) -> bool:
        """Settle ended motions, stop abandoned ones, publish; whether a motion ended."""
        if self._session.connected:
            self._linked_s = wall_s
        away_s = wall_s - self._linked_s
        ended = []
        for calls in self._calls.values():
            if calls.settle(wall_s, self._grace_s):
                ended.append(calls.robot)
            elif 0.0 < away_s < self._unlinked_s:
                calls.postpone_watchdog(wall_s)
            elif calls.abandoned(wall_s, self._watchdog_s):
                calls.stop("nobody asked about it any more")
                ended.append(calls.robot)
        self._publisher.publish(tuple(ended))
        return bool(ended)
