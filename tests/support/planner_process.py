"""A planner process on a real router, and a person who plays the robots' part on their keys."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

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
    REPORT,
    ROBOT_ALIVE,
    ROBOT_SPEC,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress, GoalState
from keyexpr_schema.payloads.plans import PlanAddress, PlanState
from keyexpr_schema.payloads.requests import PlanRequest, RequestAddress
from keyexpr_schema.payloads.robots import AliveAddress, RobotAddress
from keyexpr_schema.payloads.tasks import Order, Report, ReportAddress, ReportState
from keyexpr_schema.payloads.world import FactAddress, ObjectAddress, PlaceAddress
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from tests.support.child_process import end_child
from tests.support.household import PLACES, SKILLS, cup, fact, manipulator
from tests.support.polling import DEADLINE_S, until


class PlannerProcess:
    """`robotctl planner` as a process of its own."""

    def __init__(self, endpoint: str, data: Path, *options: str) -> None:
        self._command = [
            sys.executable, "-m", "cli.main", "planner",
            "--data", str(data), "--router", endpoint, "--realm", "test", *options,
        ]  # fmt: skip
        self.process: subprocess.Popen[str] | None = None

    async def start(self) -> None:
        self.process = subprocess.Popen(
            self._command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        line = await asyncio.to_thread(self.process.stdout.readline)
        assert line.startswith("planner ready"), line

    @property
    def pid(self) -> int:
        assert self.process is not None
        return self.process.pid

    def close(self) -> None:
        """Have it end, if it is there and has not been ended."""
        if self.process is None:
            return
        if self.process.poll() is None:
            print(self.end(), file=sys.stderr)  # shown where the test fails
        end_child(self.process)

    def kill(self) -> None:
        assert self.process is not None
        self.process.kill()
        self.end()

    def end(self) -> str:
        """Wait for its end; what it said on stderr."""
        assert self.process is not None
        if self.process.poll() is None:
            self.process.terminate()
        try:
            _, said = self.process.communicate(timeout=DEADLINE_S)
        finally:
            end_child(self.process)
        return said


@asynccontextmanager
async def planner(endpoint: str, data: Path, *options: str) -> AsyncIterator[PlannerProcess]:
    process = PlannerProcess(endpoint, data, *options)
    try:
        await process.start()
        yield process
    finally:
        process.close()


@asynccontextmanager
async def person(endpoint: str, cups: int = 1) -> AsyncIterator[Session]:
    """A session of somebody who has set up a household with one manipulator that is connected."""
    config = SessionConfig((endpoint,), "test", "person", connect_timeout_s=DEADLINE_S)
    async with (
        open_session(config) as session,
        session.token(ROBOT_ALIVE, AliveAddress("hsr", "i1")),
    ):
        await session.confirm(ROBOT_SPEC, RobotAddress("hsr"), manipulator())
        for place in PLACES:
            await session.confirm(PLACE, PlaceAddress(place.place), place)
        known = [fact("hsr", "holding", "nothing")]
        for number in range(1, cups + 1):
            thing = cup(number)
            await session.confirm(OBJECT, ObjectAddress(thing.object), thing)
            known.append(fact(thing.object, "at", "kitchen"))
        for each in known:
            await session.confirm(FACT, FactAddress.of(each.key), each)
        yield session


async def value(session: Session, key: Key[Any, Any], address: Address, **fields: Any) -> Any:
    """Wait until the value at a key has these fields."""

    async def look() -> Any:
        found = await session.get(key, address)
        if found is not None and all(getattr(found, k) == v for k, v in fields.items()):
            return found
        return None

    return await until(look, f"{key.build(address)} with {fields}")


async def ask_for_plan(
    session: Session, text: str = "Bring cup 1 to the hallway", by: str = "symbolic"
) -> None:
    await want(session, text)
    await have_planned(session, by)


async def want(session: Session, text: str) -> None:
    """Put the goal `g`."""
    await session.confirm(GOAL_SPEC, GoalAddress("g"), Goal(goal="g", text=text))


async def have_planned(session: Session, by: str = "symbolic") -> None:
    """Ask for the plan `p` once there is a goal that waits for one."""
    await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.WAITING)
    request = PlanRequest(request="r", plan="p", planner=by)
    await session.confirm(PLAN_REQUEST, RequestAddress("r"), request)
    await value(session, ANSWER, RequestAddress("r"), accepted=True)


async def next_order(session: Session, done: set[str]) -> Order:
    async def look() -> Order | None:
        orders = await session.list(ORDER, robot="hsr")
        return next((o for o in orders.values() if o.task not in done), None)

    order = await until(look, "an order")
    assert isinstance(order, Order)
    return order


async def carry_out(session: Session, order: Order, took_s: float | None = None) -> None:
    """Do an order as a worker does: the facts that follow, then a report that it is done, and
    perhaps how long it took."""
    facts = tuple(
        fact(literal.variable.subject, literal.variable.relation, str(literal.value), order.robot)
        for literal in SKILLS[order.skill].ground(order.args).after
    )
    for known in facts:
        await session.confirm(FACT, FactAddress.of(known.key), known)
    await report(
        session,
        order,
        ReportState.SUCCEEDED,
        facts=facts,
        started_s=None if took_s is None else 100.0,
        ended_s=100.0 + (took_s or 0.0),
    )


async def report(session: Session, order: Order, state: ReportState, **more: Any) -> None:
    """Say what became of an order, as its worker does."""
    said = Report(
        robot=order.robot, plan=order.plan, revision=order.revision, task=order.task,
        attempt=order.attempt, epoch=order.epoch, incarnation="i1", state=state, **more,
    )  # fmt: skip
    await session.confirm(REPORT, ReportAddress.of(said), said)


async def finish(session: Session, done: set[str], took_s: float | None = None) -> None:
    while len(done) < 4:
        order = await next_order(session, done)
        done.add(order.task)
        await carry_out(session, order, took_s)
    await value(session, PLAN_STATUS, PlanAddress("p"), state=PlanState.SUCCEEDED)
    await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.REACHED)
