"""`SimEmbodiment`: drives one simulated robot, for the worker that stands behind it."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager, suppress
from weakref import WeakKeyDictionary

from keyexpr_schema.errors import NoReply
from keyexpr_schema.keyspace import SIM_CLOCK, SIM_MOTION, SIM_SENSES
from keyexpr_schema.payloads.motions import Motion, MotionOutcome, MotionState, Senses
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.simulation import MotionCall, SimRobotAddress
from keyexpr_schema.transport.session import Session
from workers.errors import RobotUnreachable

POLL_S = 1.0
"""Wall time for which one question is left open at the simulation."""

SLACK_S = 1.0
"""How much longer than `POLL_S` an answer may take."""


class _SimulatedTime:
    """The simulation's clock, as one session hears it: one for all robots of a process.

    It goes back only where the simulation says so: when another one has started.
    """

    def __init__(self) -> None:
        self.time_s = 0.0
        self._ticked_s = 0.0
        self._users = 0
        self._following: asyncio.Task[None] | None = None

    @asynccontextmanager
    async def followed(self, session: Session) -> AsyncIterator[None]:
        """Follow the clock while anybody is in the block."""
        self._users += 1
        if self._following is None:
            self._following = asyncio.create_task(self._follow(session))
        try:
            yield
        finally:
            self._users -= 1
            if self._users == 0:
                following, self._following = self._following, None
                following.cancel()
                await asyncio.gather(following, return_exceptions=True)

    def hear(self, time_s: float) -> None:
        """A robot's senses say how late it is."""
        self.time_s = max(self.time_s, time_s)

    async def _follow(self, session: Session) -> None:
        async with session.watch(SIM_CLOCK) as watch:
            async for change in watch:
                if change.value is None:
                    continue
                now_s = change.value.time_s
                # A clock that is set back, or stands, is right, whatever senses have said.
                self.time_s = now_s if now_s <= self._ticked_s else max(self.time_s, now_s)
                self._ticked_s = now_s


_times: WeakKeyDictionary[Session, _SimulatedTime] = WeakKeyDictionary()


class SimEmbodiment(AbstractAsyncContextManager["SimEmbodiment"]):
    """One simulated robot, over Zenoh. Within `async with` it also follows the simulation's clock
    and the robot's senses.

    Every motion is a call with a name of its own: asked as often as it takes until the answer is
    there, carried out once. `patience_s` is how long, in wall time, router or simulation may be
    away before a method raises `RobotUnreachable`.
    """

    def __init__(
        self, session: Session, robot: str, incarnation: str, patience_s: float = 30.0
    ) -> None:
        self.robot = robot
        self._session = session
        self._incarnation = incarnation
        self._patience_s = patience_s
        self._time = _times.setdefault(session, _SimulatedTime())
        self._sensed: asyncio.Future[Senses] | None = None
        self._stack = AsyncExitStack()

    async def __aenter__(self) -> SimEmbodiment:
        await self._stack.enter_async_context(self._time.followed(self._session))
        self._sensing = asyncio.create_task(self._follow_senses())
        return self

    async def __aexit__(self, *_: object) -> None:
        self._sensing.cancel()
        await asyncio.gather(self._sensing, return_exceptions=True)
        await self._stack.aclose()

    def now_s(self) -> float:
        """Simulated seconds, as last heard."""
        return self._time.time_s

    async def next_senses(self) -> Senses:
        """What the simulation says next of the robot's senses."""
        if self._sensed is None:
            self._sensed = asyncio.get_running_loop().create_future()
        return await asyncio.shield(self._sensed)

    async def _follow_senses(self) -> None:
        async with self._session.watch((SIM_SENSES, {"robot": self.robot})) as watch:
            async for change in watch:
                if change.value is not None:
                    self._time.hear(change.value.time_s)
                    if self._sensed is not None:
                        self._sensed.set_result(change.value)
                        self._sensed = None

    async def perform(self, motion: Motion) -> MotionOutcome:
        """Carry out `motion` once; see `workers.embodiment.Embodiment.perform`."""
        call = self._call(motion)
        try:
            outcome = await self._ask(call)
            while outcome.state is MotionState.RUNNING:
                outcome = await self._ask(call)
        except asyncio.CancelledError:
            # If this does not get through, the simulation notices that nobody asks any more.
            await asyncio.shield(self._halt(call))
            raise
        return outcome

    async def senses(self) -> Senses:
        """What the robot knows of itself."""
        return (await self._ask(self._call(None))).senses

    async def stop(self) -> None:
        """Bring the robot to rest, whatever it does; it stays there until its next motion or
        `release`. Returns when it rests.

        Raises:
            RobotUnreachable: the simulation does not answer, or the robot does not come to rest.
        """
        call = self._call(None, stop=True)
        outcome = await self._ask(call)
        while outcome.state is MotionState.RUNNING:
            outcome = await self._ask(call)
        if outcome.state is MotionState.FAILED:
            raise RobotUnreachable(f"{self.robot} is not at rest: {outcome.reason}")

    async def release(self) -> None:
        """It may be moved out of others' way again."""
        await self._ask(self._call(None, release=True))

    def _call(
        self, motion: Motion | None, name: str = "", stop: bool = False, release: bool = False
    ) -> MotionCall:
        return MotionCall(
            call=name or f"c{secrets.token_hex(8)}",
            incarnation=self._incarnation,
            motion=motion,
            stop=stop,
            wait_s=POLL_S,
            release=release,
        )

    async def _halt(self, call: MotionCall) -> None:
        running = True
        with suppress(RobotUnreachable, TimeoutError):
            while running:
                async with asyncio.timeout(2 * POLL_S):
                    outcome = await self._ask(self._call(None, call.call, stop=True))
                running = outcome.state is MotionState.RUNNING

    async def _ask(self, call: MotionCall) -> MotionOutcome:
        """The answer to `call`, asked again while router or simulation are away."""
        loop = asyncio.get_running_loop()
        deadline_s = loop.time() + self._patience_s
        pause_s = 0.05
        while True:
            try:
                outcome: MotionOutcome = await self._session.query(
                    SIM_MOTION, SimRobotAddress(self.robot), call, POLL_S + SLACK_S
                )
            except NoReply as error:
                if loop.time() + pause_s > deadline_s:
                    raise RobotUnreachable(f"the simulation does not answer: {error}") from None
                await asyncio.sleep(pause_s)
                pause_s = min(1.0, 2 * pause_s)
            else:
                self._time.hear(outcome.senses.time_s)
                return outcome


def sim_embodiment(session: Session, spec: RobotSpec, incarnation: str) -> SimEmbodiment:
    """An `EmbodimentFactory`: the simulated robot that `spec` describes."""
    return SimEmbodiment(session, spec.robot, incarnation)
