"""The retry machine: tries, reasons, deadline, cancellation, bugs. The clock is a variable."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable

import pytest

from keyexpr_schema.errors import NoReply
from keyexpr_schema.payloads.tasks import Report, ReportState
from workers.errors import SkillFailed
from workers.retry import run_attempt

REPORT = Report(
    robot="hsr",
    plan="p",
    revision=1,
    task="t1",
    attempt=1,
    epoch=1,
    incarnation="i1",
    state=ReportState.STARTED,
)


class Bench:
    """A clock that moves when told, and a log of what was done."""

    def __init__(self) -> None:
        self.time_s = 100.0
        self.done: list[str] = []
        self.cancelled = asyncio.Event()

    async def make_safe(self) -> None:
        self.done.append("safe")

    async def run(self, once: Callable[[], Awaitable[None]], deadline_s: float = 60.0) -> Report:
        return await run_attempt(
            REPORT,
            "pick",
            once,
            now_s=lambda: self.time_s,
            make_safe=self.make_safe,
            deadline_s=deadline_s,
            cancelled=self.cancelled,
        )


async def test_the_third_try_may_succeed_and_every_try_is_told() -> None:
    bench = Bench()
    reasons = iter(["it slipped", "it slipped again"])

    async def once() -> None:
        bench.time_s += 5.0
        bench.done.append("try")
        if reason := next(reasons, None):
            raise SkillFailed(reason)

    ended = await bench.run(once)
    assert ended.state is ReportState.SUCCEEDED and ended.reason is None
    assert [(t.number, t.started_s, t.ended_s, t.reason) for t in ended.tries] == [
        (1, 100.0, 105.0, "it slipped"),
        (2, 105.0, 110.0, "it slipped again"),
        (3, 110.0, 115.0, None),
    ]
    assert bench.done == ["try", "safe", "try", "safe", "try"]


async def test_after_three_tries_it_has_failed_with_the_last_reason() -> None:
    bench = Bench()

    async def once() -> None:
        bench.done.append("try")
        raise SkillFailed(f"miss {bench.done.count('try')}")

    ended = await bench.run(once)
    assert (ended.state, ended.reason, ended.retryable) == (ReportState.FAILED, "miss 3", True)
    assert bench.done == ["try", "safe"] * 3


async def test_what_cannot_be_retried_is_not() -> None:
    bench = Bench()

    async def once() -> None:
        raise SkillFailed("there is no such cup", retryable=False)

    ended = await bench.run(once)
    assert (len(ended.tries), ended.retryable) == (1, False)
    assert bench.done == ["safe"]


async def test_the_deadline_counts_fleet_seconds_over_all_tries() -> None:
    bench = Bench()
    stopped = asyncio.Event()

    async def once() -> None:
        if not bench.done:
            bench.time_s += 50.0
            raise SkillFailed("a slow miss")
        bench.time_s += 50.0
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            stopped.set()
            raise

    ended = await bench.run(once, deadline_s=60.0)
    assert stopped.is_set(), "the motion was not stopped"
    assert ended.state is ReportState.FAILED
    assert ended.reason == "pick was not done within its deadline of 60 s"
    assert [t.reason for t in ended.tries] == ["a slow miss", ended.reason]
    assert bench.done[-1] == "safe"


async def test_a_cancelled_order_stops_the_motion() -> None:
    bench = Bench()
    moving, stopped = asyncio.Event(), asyncio.Event()

    async def once() -> None:
        moving.set()
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            stopped.set()
            raise

    running = asyncio.create_task(bench.run(once))
    await moving.wait()
    bench.cancelled.set()
    ended = await running
    assert stopped.is_set()
    assert ended.state is ReportState.CANCELLED and len(ended.tries) == 1
    assert bench.done == ["safe"]


async def test_a_bug_in_a_skill_ends_the_attempt_and_is_logged(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bench = Bench()

    async def once() -> None:
        raise ZeroDivisionError("division by zero")

    with caplog.at_level(logging.ERROR):
        ended = await bench.run(once)
    assert ended.reason == "unexpected error in skill pick: ZeroDivisionError: division by zero"
    assert (ended.state, ended.retryable, len(ended.tries)) == (ReportState.FAILED, False, 1)
    assert "Traceback" in caplog.text


async def test_a_driver_that_does_not_answer_is_tried_again() -> None:
    bench = Bench()

    async def once() -> None:
        raise NoReply("nobody serves sim/robots/hsr/motion")

    ended = await bench.run(once)
    assert len(ended.tries) == 3 and ended.retryable
    assert ended.reason == "nobody serves sim/robots/hsr/motion"


async def test_being_cancelled_oneself_stops_the_try_and_goes_through() -> None:
    bench = Bench()
    moving, stopped = asyncio.Event(), asyncio.Event()

    async def once() -> None:
        moving.set()
        try:
            await asyncio.Event().wait()
        finally:
            stopped.set()

    running = asyncio.create_task(bench.run(once))
    await moving.wait()
    running.cancel()
    with pytest.raises(asyncio.CancelledError):
        await running
    assert stopped.is_set()
