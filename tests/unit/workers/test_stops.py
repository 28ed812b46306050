"""A stopped robot: what its body does, and when it is said to rest."""

from __future__ import annotations

import asyncio

import pytest

from keyexpr_schema.payloads.motions import Motion, MotionKind, MotionOutcome, MotionState, Senses
from keyexpr_schema.payloads.stops import Stop, holding
from tests.support.polling import DEADLINE_S
from workers.errors import RobotUnreachable
from workers.stops import StoppableBody, StopSwitch, obey_stops

SENSES = Senses(robot="r1", time_s=0.0, pose_m_rad=(0.0, 0.0, 0.0), place=None)
GO = Motion(kind=MotionKind.GO_TO, place="kitchen")
S1 = (Stop(stop="s1", by="ana", reason="smoke"),)


class Body:
    """Moves until it is told to end; its driver leaves the first `silent` stops unanswered."""

    robot = "r1"

    def __init__(self, silent: int = 0) -> None:
        self.silent = silent
        self.begun = asyncio.Event()
        self.ended = asyncio.Event()
        self.moving = 0

    async def perform(self, motion: Motion) -> MotionOutcome:
        self.moving += 1
        self.begun.set()
        try:
            await self.ended.wait()
        finally:
            self.moving -= 1
        return MotionOutcome(state=MotionState.SUCCEEDED, senses=SENSES)

    async def senses(self) -> Senses:
        return SENSES

    async def stop(self) -> None:
        self.silent -= 1
        if self.silent >= 0:
            raise RobotUnreachable("nobody answers")

    def now_s(self) -> float:
        return 0.0


async def test_a_motion_ends_when_a_stop_comes_and_none_begins_before_it_is_over() -> None:
    body, switch = Body(), StopSwitch()
    guarded = StoppableBody(body, switch)
    moving = asyncio.create_task(guarded.perform(GO))
    await body.begun.wait()
    switch.set(S1)
    outcome = await moving
    assert outcome.state is MotionState.STOPPED
    assert outcome.reason == "emergency stop s1 by ana (smoke)"
    assert body.moving == 0
    body.begun.clear()
    waiting = asyncio.create_task(guarded.perform(GO))
    await asyncio.wait([waiting], timeout=0)
    assert not body.begun.is_set()
    switch.set(())
    await body.begun.wait()
    body.ended.set()
    assert (await waiting).state is MotionState.SUCCEEDED


async def test_rest_is_confirmed_when_the_driver_has_answered_and_not_before() -> None:
    body, switch = Body(silent=1), StopSwitch()
    confirmed: list[tuple[tuple[str, ...], int]] = []
    news = asyncio.Event()

    async def confirm(stops: tuple[str, ...]) -> None:
        confirmed.append((stops, body.silent))
        news.set()

    obeying = asyncio.create_task(obey_stops(switch, StoppableBody(body, switch), confirm))
    switch.set(S1)
    async with asyncio.timeout(DEADLINE_S):
        await news.wait()
    assert confirmed == [(("s1",), -1)]
    news.clear()
    switch.set(())
    await news.wait()
    assert confirmed[1][0] == ()
    obeying.cancel()
    await asyncio.wait([obeying])


async def test_a_robot_that_is_let_go_before_it_rests_is_not_stopped_again(
    caplog: pytest.LogCaptureFixture,
) -> None:
    switch, confirmed = StopSwitch(), asyncio.Event()

    class Released(Body):
        async def stop(self) -> None:
            switch.set(())  # as a lease that comes: the next motion takes the place of the stop
            await super().stop()

    body = Released(silent=1)

    async def confirm(stops: tuple[str, ...]) -> None:
        assert stops == ()
        confirmed.set()

    obeying = asyncio.create_task(obey_stops(switch, StoppableBody(body, switch), confirm))
    switch.set(S1)
    async with asyncio.timeout(DEADLINE_S):
        await confirmed.wait()
    assert body.silent == 0
    assert not [each for each in caplog.records if "cannot be stopped" in each.getMessage()]
    obeying.cancel()
    await asyncio.wait([obeying])


async def test_a_lease_that_ran_out_is_told_and_one_that_is_not_there_yet_is_not(
    caplog: pytest.LogCaptureFixture,
) -> None:
    now_s, switch, rested = 100.0, StopSwitch(lambda: now_s), asyncio.Event()

    async def confirm(_stops: tuple[str, ...]) -> None:
        rested.set()

    async def after(until_s: float, now: float) -> list[str]:
        nonlocal now_s
        switch.lease_until(until_s)
        if not switch.held:
            await rested.wait()
            rested.clear()
        now_s = now
        switch.look()
        async with asyncio.timeout(DEADLINE_S):
            await rested.wait()
        rested.clear()
        return [record.getMessage() for record in caplog.records]

    obeying = asyncio.create_task(obey_stops(switch, StoppableBody(Body(), switch), confirm))
    assert await after(now_s, now_s) == []
    assert await after(now_s + 8.0, now_s + 9.0) == [
        "r1 rests: the planner was not heard of for the length of its lease"
    ]
    obeying.cancel()
    await asyncio.wait([obeying])


def test_who_is_held() -> None:
    stops = {"b": Stop(stop="b", robots=("r1",)), "a": Stop(stop="a")}
    assert [s.stop for s in holding("r1", stops, set())] == ["a", "b"]
    assert [s.stop for s in holding("r2", stops, set())] == ["a"]
    assert [s.stop for s in holding("r1", stops, {("a", "r1")})] == ["b"]
    assert holding("r2", stops, {("a", "r2")}) == ()
