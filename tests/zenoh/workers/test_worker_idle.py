"""What an idle worker asks for: nothing, where the driver says by itself what the sensors give."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from keyexpr_schema.keyspace import ROBOT_STATE
from keyexpr_schema.payloads.motions import Motion, MotionOutcome, MotionState, Senses
from keyexpr_schema.payloads.robots import RobotActivity, RobotAddress
from keyexpr_schema.transport.session import SessionConfig, open_session
from tests.support.polling import until
from workers.state_publisher import StatePublisher


class Body:
    """A robot that stands in the kitchen; counts how often its sensors are asked."""

    robot = "hsr"

    def __init__(self) -> None:
        self.asked = 0
        self.pushed: asyncio.Queue[Senses] = asyncio.Queue()

    def sensed(self, time_s: float, place: str = "kitchen") -> Senses:
        return Senses(robot="hsr", time_s=time_s, pose_m_rad=(1.0, 2.0, 0.0), place=place)

    async def senses(self) -> Senses:
        self.asked += 1
        return self.sensed(float(self.asked))

    async def perform(self, motion: Motion) -> MotionOutcome:
        return MotionOutcome(state=MotionState.SUCCEEDED, senses=self.sensed(0.0))

    async def stop(self) -> None:
        pass

    def now_s(self) -> float:
        return 2000.0


class PushingBody(Body):
    async def next_senses(self) -> Senses:
        return await self.pushed.get()


async def test_sensors_that_speak_by_themselves_are_asked_once(
    session_config: Callable[..., SessionConfig],
) -> None:
    async with open_session(session_config(component="worker-hsr")) as session:
        body = PushingBody()
        publisher = StatePublisher(session, body, "i1")
        running = asyncio.create_task(publisher.run())
        try:
            publisher.set_activity(RobotActivity.IDLE)
            body.pushed.put_nowait(body.sensed(1e9, place="attic"))  # it keeps nothing out
            for number in range(200):
                body.pushed.put_nowait(body.sensed(10.0 + number))
            body.pushed.put_nowait(body.sensed(999.0, place="hallway"))

            async def published() -> bool:
                state = await session.get(ROBOT_STATE, RobotAddress("hsr"))
                return state is not None and state.place == "hallway"

            await until(published, "the state with the place that was pushed")
            assert body.asked == 1
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)


async def test_sensors_that_do_not_are_asked_again_at_once_when_work_begins(
    session_config: Callable[..., SessionConfig],
) -> None:
    async with open_session(session_config(component="worker-hsr")) as session:
        body = Body()
        publisher = StatePublisher(session, body, "i1")
        publisher.set_activity(RobotActivity.IDLE)
        running = asyncio.create_task(publisher.run())
        try:
            for activity in (RobotActivity.BUSY, RobotActivity.IDLE) * 3:
                before = body.asked
                publisher.set_activity(activity)
                await until(lambda before=before: body.asked > before, "the sensors to be asked")
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
