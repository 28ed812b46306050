"""A fleet on its keys: someone who puts a household and plans, and robots that report at once."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Iterable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from typing import Any

from msgspec.structs import replace

from benchmarks.scale import errands
from benchmarks.scale.errands import Errands
from benchmarks.scale.planner_news import PlannerNews
from benchmarks.scale.processes import REALM
from keyexpr_schema.keyspace import (
    FACT,
    GOAL_SPEC,
    OBJECT,
    ORDER,
    PLACE,
    PLAN_PROPOSAL,
    REPORT,
    ROBOT_ALIVE,
    ROBOT_SPEC,
)
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.plans import PlanAddress, PlanState
from keyexpr_schema.payloads.robots import AliveAddress, RobotAddress
from keyexpr_schema.payloads.tasks import Order, ReportAddress, ReportState
from keyexpr_schema.payloads.world import FactAddress, ObjectAddress, PlaceAddress
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from workers.orders.outbox import make_report

AT_ONCE = 64
"""Confirmed writes under way at a time."""
CONFIRM_S = 120.0
INCARNATION = "i1"


@dataclass
class KeysRun(PlannerNews):
    """Made by `keys_run`. Times are of `time.perf_counter`, s."""

    operator: Session
    workers: Session
    robots: int
    pace_s: Callable[[], float] = lambda: 0.0
    """How long a robot takes for its next task."""
    ordered: dict[tuple[str, str], float] = field(default_factory=dict)
    """When the order of a plan's task came to its worker."""
    reported: dict[tuple[str, str], float] = field(default_factory=dict)
    """When its worker put the report that it is done."""
    latencies_s: list[float] = field(default_factory=list)
    """From a robot's report that it is done to its next order, which waited for nothing else."""
    epoch: int = 0
    """The epoch of the newest order."""
    _free_since: dict[str, float] = field(default_factory=dict)
    _reporting: set[asyncio.Task[None]] = field(default_factory=set)

    # --- what robots do --------------------------------------------------------------------------

    async def follow_orders(self) -> None:
        """Every order is begun and, after `pace_s`, reported as done."""
        async with self.workers.watch(ORDER) as watch:
            async for change in watch:
                order = change.value
                if order is None or order.cancelled:
                    continue
                now_s = time.perf_counter()
                self.epoch = max(self.epoch, order.epoch)
                if self.ordered.setdefault((order.plan, order.task), now_s) == now_s:
                    if (free_s := self._free_since.pop(order.robot, None)) is not None:
                        self.latencies_s.append(now_s - free_s)
                    self._in_background(self._carry_out(order))

    def _in_background(self, reporting: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(reporting)
        self._reporting.add(task)
        task.add_done_callback(self._reporting.discard)

    async def _carry_out(self, order: Order) -> None:
        began_s = time.time()
        report = make_report(order, INCARNATION, ReportState.STARTED, started_s=began_s)
        self._in_background(
            self.workers.confirm(REPORT, ReportAddress.of(report), report, CONFIRM_S)
        )
        await asyncio.sleep(self.pace_s())  # if for nothing: that is sent before what comes next
        report = replace(report, state=ReportState.SUCCEEDED, ended_s=began_s + errands.DURATION_S)
        now_s = time.perf_counter()
        self.reported[order.plan, order.task] = self._free_since[order.robot] = now_s
        await self.workers.confirm(REPORT, ReportAddress.of(report), report, CONFIRM_S)

    # --- what the operator sees ------------------------------------------------------------------

    def done(self, plan: str) -> int:
        """How many tasks of a plan were reported as done."""
        return sum(name == plan for name, _ in self.reported)

    # --- what the operator puts ------------------------------------------------------------------

    async def put_fleet(self) -> None:
        """Rooms and robots; their workers are there already."""
        confirm = self.operator.confirm
        await at_once(
            confirm(PLACE, PlaceAddress(place.place), place, CONFIRM_S)
            for place in errands.places()
        )
        numbers = range(self.robots)
        await at_once(
            confirm(ROBOT_SPEC, RobotAddress(f"r{n}"), errands.robot(n), CONFIRM_S) for n in numbers
        )
        await at_once(
            confirm(FACT, FactAddress.of(fact.key), fact, CONFIRM_S)
            for n in numbers
            for fact in errands.robot_facts(n)
        )

    async def put_cups(self, numbers: Sequence[int]) -> None:
        """The things that goals are about."""
        confirm = self.operator.confirm
        await at_once(
            confirm(OBJECT, ObjectAddress(f"cup_{n}"), errands.cup(n), CONFIRM_S) for n in numbers
        )
        facts = [errands.cup_fact(n) for n in numbers]
        await at_once(confirm(FACT, FactAddress.of(fact.key), fact, CONFIRM_S) for fact in facts)

    async def put_goals(
        self, numbers: Sequence[int], limit_s: float, cups: int | None = None
    ) -> bool:
        """Goals, by their conditions; whether all were read within `limit_s`."""
        confirm = self.operator.confirm
        await at_once(
            confirm(GOAL_SPEC, GoalAddress(f"g{n}"), errands.goal(n, cups=cups), CONFIRM_S)
            for n in numbers
        )
        names = {f"g{n}" for n in numbers}
        return await self.until(lambda: names <= self.goals.keys(), limit_s)

    async def propose(self, wanted: Errands) -> None:
        """The plan is put for the planner to check, to allocate and to carry out."""
        address = PlanAddress(wanted.plan)
        await self.operator.confirm(PLAN_PROPOSAL, address, wanted.written(), CONFIRM_S)

    async def mission(self, wanted: Errands, limit_s: float) -> bool:
        """Cups, goals and a plan for them; whether it succeeded within `limit_s`."""
        await self.put_cups(wanted.numbers)
        if not await self.put_goals(wanted.numbers, limit_s):
            return False
        await self.propose(wanted)
        await self.until(lambda: wanted.plan in self.ended, limit_s)
        return self.plans.get(wanted.plan) is PlanState.SUCCEEDED


@asynccontextmanager
async def keys_run(
    endpoint: str, robots: int, pace_s: Callable[[], float] = lambda: 0.0
) -> AsyncIterator[KeysRun]:
    """Someone and so many robots at a router; the robots' workers are all in this process."""
    config = SessionConfig((endpoint,), realm=REALM, component="benchmark", lease_s=10.0)
    async with AsyncExitStack() as stack:
        operator = await stack.enter_async_context(open_session(config))
        workers = await stack.enter_async_context(open_session(config))
        for number in range(robots):
            address = AliveAddress(f"r{number}", INCARNATION)
            await stack.enter_async_context(workers.token(ROBOT_ALIVE, address))
        run = KeysRun(operator, workers, robots, pace_s)
        following = [
            asyncio.create_task(run.follow_orders()),
            asyncio.create_task(run.follow_planner(operator)),
        ]
        try:
            yield run
        finally:
            for task in (*following, *run._reporting):
                task.cancel()
            await asyncio.gather(*following, *run._reporting, return_exceptions=True)


async def at_once(writes: Iterable[Awaitable[Any]], together: int = AT_ONCE) -> None:
    """Await all, so many at a time."""
    waiting = iter(writes)

    async def some() -> None:
        for write in waiting:
            await write

    await asyncio.gather(*(some() for _ in range(together)))
