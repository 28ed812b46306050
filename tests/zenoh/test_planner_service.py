"""The planner process on a real router; the test plays the robots' part on their keys."""

from __future__ import annotations

import asyncio
import shutil
import subprocess
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from keyexpr_schema.goals import Goal, GoalAddress, GoalState
from keyexpr_schema.key import Address, Key
from keyexpr_schema.keyspace import (
    ANSWER,
    FACT,
    GOAL_SPEC,
    GOAL_STATUS,
    OBJECT,
    ORDER,
    PLACE,
    PLAN_REQUEST,
    PLAN_STATUS,
    PLANNER_STATUS,
    REJECT,
    REPORT,
    ROBOT_ALIVE,
    ROBOT_SPEC,
)
from keyexpr_schema.plans import PlanAddress, PlanState
from keyexpr_schema.requests import PlanRequest, RequestAddress
from keyexpr_schema.robots import AliveAddress, RobotAddress
from keyexpr_schema.service import PlannerAddress
from keyexpr_schema.session import Session, SessionConfig, open_session
from keyexpr_schema.tasks import Order, OrderAddress, Report, ReportAddress, ReportState
from keyexpr_schema.world import FactAddress, ObjectAddress, PlaceAddress
from tests.household import PLACES, SKILLS, cup, fact, manipulator

DEADLINE_S = 30.0


class PlannerProcess:
    """`robotctl planner` as a process of its own."""

    def __init__(self, endpoint: str, data: Path) -> None:
        self._command = [
            sys.executable, "-m", "cli.main", "planner",
            "--data", str(data), "--router", endpoint, "--realm", "test",
        ]  # fmt: skip
        self.process: subprocess.Popen[str] | None = None

    async def start(self) -> None:
        self.process = subprocess.Popen(
            self._command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        line = await asyncio.to_thread(self.process.stdout.readline)
        assert line.startswith("planner ready"), line

    def kill(self) -> None:
        assert self.process is not None
        self.process.kill()
        self.end()

    def end(self) -> str:
        """Wait for its end; what it said on stderr."""
        assert self.process is not None
        if self.process.poll() is None:
            self.process.terminate()
        _, said = self.process.communicate(timeout=10)
        return said


@asynccontextmanager
async def planner(endpoint: str, data: Path) -> AsyncIterator[PlannerProcess]:
    process = PlannerProcess(endpoint, data)
    try:
        await process.start()
        yield process
    finally:
        if process.process is not None and process.process.poll() is None:
            process.end()


@asynccontextmanager
async def person(endpoint: str) -> AsyncIterator[Session]:
    """A session of somebody who has set up a household with one manipulator that is connected."""
    config = SessionConfig(endpoints=(endpoint,), realm="test", component="person")
    async with (
        open_session(config) as session,
        session.token(ROBOT_ALIVE, AliveAddress("hsr", "i1")),
    ):
        await session.confirm(ROBOT_SPEC, RobotAddress("hsr"), manipulator())
        for place in PLACES:
            await session.confirm(PLACE, PlaceAddress(place.place), place)
        await session.confirm(OBJECT, ObjectAddress("cup_1"), cup(1))
        for known in (fact("cup_1", "at", "kitchen"), fact("hsr", "holding", "nothing")):
            await session.confirm(FACT, FactAddress(known.subject, known.relation), known)
        yield session


async def until(look: Callable[[], Awaitable[Any]], what: str) -> Any:
    """The first true answer of `look`."""
    try:
        async with asyncio.timeout(DEADLINE_S):
            while not (found := await look()):
                await asyncio.sleep(0.02)
            return found
    except TimeoutError:
        pytest.fail(f"{what} did not come within {DEADLINE_S:g} s")


async def value(session: Session, key: Key[Any, Any], address: Address, **fields: Any) -> Any:
    """Wait until the value at a key has these fields."""

    async def look() -> Any:
        found = await session.get(key, address)
        if found is not None and all(getattr(found, k) == v for k, v in fields.items()):
            return found
        return None

    return await until(look, f"{key.build(address)} with {fields}")


async def ask_for_plan(session: Session, text: str = "Bring cup 1 to the hallway") -> None:
    await session.confirm(GOAL_SPEC, GoalAddress("g"), Goal(goal="g", text=text))
    await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.WAITING)
    request = PlanRequest(request="r", plan="p")
    await session.confirm(PLAN_REQUEST, RequestAddress("r"), request)
    await value(session, ANSWER, RequestAddress("r"), accepted=True)


async def next_order(session: Session, done: set[str]) -> Order:
    async def look() -> Order | None:
        orders = await session.list(ORDER, robot="hsr")
        return next((o for o in orders.values() if o.task not in done), None)

    order = await until(look, "an order")
    assert isinstance(order, Order)
    return order


async def carry_out(session: Session, order: Order) -> None:
    """Report an order as done, with the facts that follow."""
    facts = tuple(
        fact(literal.variable.subject, literal.variable.relation, str(literal.value), "hsr")
        for literal in SKILLS[order.skill].ground(order.args).after
    )
    report = Report(
        robot="hsr", plan=order.plan, revision=order.revision, task=order.task,
        attempt=order.attempt, epoch=order.epoch, incarnation="i1",
        state=ReportState.SUCCEEDED, facts=facts,
    )  # fmt: skip
    await session.confirm(
        REPORT, ReportAddress("hsr", order.plan, order.task, order.attempt), report
    )


async def finish(session: Session, done: set[str]) -> None:
    while len(done) < 4:
        order = await next_order(session, done)
        done.add(order.task)
        await carry_out(session, order)
    await value(session, PLAN_STATUS, PlanAddress("p"), state=PlanState.SUCCEEDED)
    await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.REACHED)


async def test_a_goal_is_planned_ordered_and_reached(router: Any, tmp_path: Path) -> None:
    async with planner(router.endpoint, tmp_path), person(router.endpoint) as session:
        await ask_for_plan(session)
        await finish(session, set())
        assert await session.list(ORDER) == {}


async def test_kill_9_in_the_middle_gives_no_attempt_twice(router: Any, tmp_path: Path) -> None:
    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path) as first:
        await ask_for_plan(session)
        before = await next_order(session, set())
        first.kill()
        done = {before.task}
        # The robot reports while no planner is there; the next one has to find it.
        await carry_out(session, before)
        await first.start()
        after = await next_order(session, done)
        assert after.epoch == before.epoch + 1
        assert after.attempt == 1
        await finish(session, done)


async def test_a_router_that_is_killed_loses_nothing(router: Any, tmp_path: Path) -> None:
    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path):
        await ask_for_plan(session)
        order = await next_order(session, set())
        router.kill()
        router.restart()
        await carry_out(session, order)
        await finish(session, {order.task})


async def test_a_planner_that_lost_its_journal_repeats_nothing(router: Any, tmp_path: Path) -> None:
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path / "one"):
            await ask_for_plan(session)
            await finish(session, set())
        shutil.rmtree(tmp_path / "one")
        async with planner(router.endpoint, tmp_path / "two"):
            request = PlanRequest(request="r2")
            await session.confirm(PLAN_REQUEST, RequestAddress("r2"), request)
            answer = await value(session, ANSWER, RequestAddress("r2"), accepted=False)
            assert "no goal that waits" in answer.sentence
            assert await session.list(ORDER) == {}


async def test_a_second_planner_takes_charge_and_the_first_stops(
    router: Any, tmp_path: Path
) -> None:
    async with planner(router.endpoint, tmp_path / "one") as first:
        async with planner(router.endpoint, tmp_path / "two"):
            assert first.process is not None
            assert await asyncio.to_thread(first.process.wait, DEADLINE_S) == 1
            assert "took charge" in first.end()


async def test_two_planners_on_one_journal_are_refused(router: Any, tmp_path: Path) -> None:
    async with planner(router.endpoint, tmp_path):
        second = PlannerProcess(router.endpoint, tmp_path)
        with pytest.raises(AssertionError):
            await second.start()
        assert "another planner works with" in second.end()


async def test_what_is_malformed_or_unknown_is_told_and_disturbs_nobody(
    router: Any, tmp_path: Path
) -> None:
    async with planner(router.endpoint, tmp_path), person(router.endpoint) as session:
        for keyexpr in ("goals/bad/spec", "requests/plan/bad", "world/facts/cup_1/colour"):
            await session.link.send(
                keyexpr, b'{"goal": 7, "text":', "application/json", session.link.new_timestamp()
            )
        dragon = Goal(goal="dragon", text="Bring the dragon to the hallway")
        await session.confirm(GOAL_SPEC, GoalAddress("dragon"), dragon)
        status = await value(session, GOAL_STATUS, GoalAddress("dragon"), state=GoalState.REJECTED)
        assert "known are cup_1" in status.reason

        async def rejected() -> bool:
            rejects = await session.list(REJECT, component="planner")
            return len(rejects) == 3

        await until(rejected, "three rejects")
        await ask_for_plan(session)
        await finish(session, set())


async def test_a_goal_deleted_while_no_planner_is_there_is_forgotten(
    router: Any, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path):
            goal = Goal(goal="g", text="Bring cup 1 to the hallway")
            await session.confirm(GOAL_SPEC, GoalAddress("g"), goal)
            await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.WAITING)
        await session.delete(GOAL_SPEC, GoalAddress("g"))
        async with planner(router.endpoint, tmp_path):

            async def gone() -> bool:
                return await session.get(GOAL_STATUS, GoalAddress("g")) is None

            await until(gone, "the status of the deleted goal to go")


async def test_a_planner_may_start_before_its_router(tmp_path: Path) -> None:
    from tests.conftest import RouterProcess

    router = RouterProcess(tmp_path / "router")
    router.kill()
    process = PlannerProcess(router.endpoint, tmp_path / "planner")
    starting = asyncio.create_task(process.start())
    try:
        router.restart()
        await starting
        config = SessionConfig(endpoints=(router.endpoint,), realm="test")
        async with open_session(config) as session:
            status = await session.get(PLANNER_STATUS, PlannerAddress())
            assert status is not None
            assert status.epoch == 1
            assert OrderAddress("hsr", "p", "t") not in await session.list(ORDER)
    finally:
        process.end()
        router.kill()
