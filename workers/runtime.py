"""`Worker`: takes a robot's orders, carries them out one at a time, and reports."""

from __future__ import annotations

import asyncio
import logging
import sqlite3
from collections.abc import Awaitable, Callable
from contextlib import suppress

from msgspec.structs import replace

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.facts import CHARGE, HOLDING, FactKey
from keyexpr_schema.full_disk import FullDisk
from keyexpr_schema.keyspace import ROBOT_ALIVE
from keyexpr_schema.payloads.programs import ProgramEnd, ProgramTrace
from keyexpr_schema.payloads.robots import AliveAddress, RobotActivity, RobotSpec
from keyexpr_schema.payloads.tasks import Order, Report, ReportState
from keyexpr_schema.transport.session import Session
from workers.embodiment import Embodiment
from workers.errors import BadArguments, RobotTaken, RobotUnreachable, UnknownSkill
from workers.only_run import OnlyRun
from workers.ordered_work import work_of
from workers.orders.fencing import Phase
from workers.orders.journal import FinishedCall, Journal
from workers.orders.order_queue import OrderQueue
from workers.orders.outbox import Outbox, make_report
from workers.programs.run import ProgramRun, traced
from workers.recovery import (
    first_senses,
    interrupted,
    make_safe,
    observe_after_crash,
    observe_robot,
    observe_what_is_left,
    was_interrupted,
)
from workers.retry import MOST_TRIES, run_attempt
from workers.shared_watch import SharedWatch
from workers.skill_context import SkillContext
from workers.skill_registry import SkillRegistry
from workers.state_publisher import StatePublisher
from workers.stops import StoppableBody, obey_stops, released_unless, unless_stopped

DRAIN_S = 3.0
"""Wall seconds that a worker which ends spends on getting its last report out."""
REPEAT_S = 5.0
"""Wall seconds between two looks whether the reports of attempts that are still ordered are there.
It costs nothing while there are none."""


class Worker:
    """One robot's worker. The journal must be open and `shared` be running; `run` ends by being
    cancelled."""

    def __init__(
        self,
        session: Session,
        spec: RobotSpec,
        embodiment: Embodiment,
        journal: Journal,
        registry: SkillRegistry,
        incarnation: str,
        shared: SharedWatch,
    ) -> None:
        self.spec = spec
        self.incarnation = incarnation
        self._session = session
        self._stops = shared.stops(spec.robot)
        self._embodiment = StoppableBody(embodiment, self._stops)
        self._journal = journal
        self._registry = registry
        self._shared = shared
        self._world = shared.world
        self._state_publisher = StatePublisher(
            session,
            embodiment,
            incarnation,
            self._tell_charge,
            lambda: spec.robot in self._world.specs,
            lambda: shared.leases.waits_of(spec.robot),
        )
        self._disk = FullDisk(
            journal.path.parent,
            f"the worker of {spec.robot}",
            "it begins no task, and reports no end of one,",
            self._state_publisher.set_trouble,
        )
        refused = self._state_publisher.set_refused
        self._outbox = Outbox(session, journal, self._disk, on_refused=refused)
        self._order_queue = OrderQueue(
            session, journal, self._outbox, spec.robot, incarnation, self._disk
        )
        self._ready = asyncio.Event()
        self._orders_known = asyncio.Event()
        self._idle = asyncio.Event()
        self._begun: list[Order] = []
        """Programs that an earlier run of the worker had begun."""
        self._log = logging.getLogger(f"robotfleet.worker.{spec.robot}")

    async def ready(self) -> None:
        """Wait until the worker has recovered and takes orders."""
        await self._ready.wait()

    async def unregistered(self) -> None:
        """Wait until the robot is registered no more, and what it had begun has ended."""
        robot, specs = self.spec.robot, self._world.specs
        while robot in specs:
            await self._world.until(lambda: robot not in specs)
            await self._idle.wait()

    async def run(self) -> None:
        """Recover, then serve until cancelled.

        A cancelled worker brings the robot to rest and reports the attempt that ran as
        interrupted.

        Raises:
            RobotTaken: another worker of this robot is connected.
        """
        robot = self.spec.robot
        own = AliveAddress(robot, self.incarnation)
        only = OnlyRun(self._session, ROBOT_ALIVE, own, self._taken, robot=robot)
        async with only.connected():
            await only.settled()
            sending = asyncio.create_task(self._outbox.run())
            taken: BaseExceptionGroup[RobotTaken] | None = None
            try:
                async with asyncio.TaskGroup() as group:
                    group.create_task(only.give_way())
                    await self._serve(sending, group)
            except* RobotTaken as others:
                taken = others
            finally:
                # While the token is still there: who sees it go must find the last report.
                try:
                    await self._drain_outbox()
                finally:
                    sending.cancel()
                    await asyncio.gather(sending, return_exceptions=True)
            if taken is not None:
                raise RobotTaken(str(taken.exceptions[0]))

    def _taken(self, others: str) -> RobotTaken:
        return RobotTaken(
            f"a worker of {self.spec.robot} is connected already ({others}): two would "
            "both carry out each order; stop that one first"
        )

    async def _serve(self, sending: asyncio.Task[None], group: asyncio.TaskGroup) -> None:
        await first_senses(self._embodiment)
        group.create_task(self._state_publisher.run())
        await self._shared.synced(self.spec.robot)
        group.create_task(
            obey_stops(self._stops, self._embodiment, self._state_publisher.set_stops)
        )
        await self._stops.released()
        await self._recover()
        group.create_task(self._receive_orders())
        group.create_task(self._order_queue.receive_again())
        group.create_task(self._repeat_reports())
        group.create_task(self._execute())
        group.create_task(_propagate(sending))
        self._ready.set()

    async def _drain_outbox(self) -> None:
        self._outbox.wake()
        with suppress(SchemaError):
            self._state_publisher.set_activity(RobotActivity.STOPPED)
        if not await self._outbox.emptied(DRAIN_S):
            self._log.warning("not everything was reported; the rest goes out at the next start")

    # --- what comes in ---------------------------------------------------------------------------

    async def _receive_orders(self) -> None:
        with self._shared.orders(self.spec.robot) as arrivals:
            for _ in range(arrivals.qsize()):
                await self._order_queue.receive(*arrivals.get_nowait())
            self._order_queue.all_received()
            self._orders_known.set()
            while True:
                await self._order_queue.receive(*await arrivals.get())

    async def _repeat_reports(self) -> None:
        """Say again what the store has lost: at the start, after a reconnection, and for ever."""
        while True:
            connections = self._session.connections
            await self._order_queue.repeat_what_is_missing()
            await self._observe_what_is_missing()
            with suppress(TimeoutError):
                async with asyncio.timeout(REPEAT_S):
                    await self._session.wait_reconnected(connections)

    def _tell_charge(self, percent: int) -> bool:
        """Whether there was room to say it."""
        ctx = self._context()
        ctx.observe(CHARGE, self.spec.robot, percent)
        try:
            self._journal.send(*ctx.observed)
        except sqlite3.Error as error:
            self._disk.found(error)
            return False
        self._disk.over()
        self._outbox.wake()
        return True

    async def _observe_what_is_missing(self) -> None:
        """Observe the robot again where the store has lost what was known of it, as when it was
        emptied. While an attempt runs, the attempt itself says what it changes."""
        robot = self.spec.robot
        if (
            FactKey(HOLDING, robot) in self._world.facts
            or robot not in self._world.specs
            or any(self._journal.ledger.in_phase(Phase.STARTED))
            or self._journal.unsent() is not None
        ):
            return
        ctx = self._context()
        with suppress(RobotUnreachable, SchemaError, TimeoutError):
            async with asyncio.timeout(REPEAT_S):
                await observe_robot(ctx)
            await self._outbox.add(*ctx.observed)

    # --- what is done ----------------------------------------------------------------------------

    async def _recover(self) -> None:
        self._state_publisher.set_activity(RobotActivity.RECOVERING)
        ledger = self._journal.ledger
        ctx = self._context()
        if was_interrupted(ledger):
            await make_safe(self._embodiment)
        await observe_robot(ctx)
        await self._outbox.add(*ctx.observed)
        for attempt in ledger.in_phase(Phase.STARTED):
            if attempt.order.program is not None:
                self._begun.append(attempt.order)
            else:
                await self._end_interrupted(attempt.order)

    async def _end_interrupted(self, order: Order) -> None:
        ctx = self._context()
        await observe_after_crash(ctx, order)
        reason = f"the worker of {self.spec.robot} went down while it did this"
        report = make_report(order, self.incarnation, ReportState.STARTED)
        if order.program is not None:
            calls = tuple(finished.call for finished in self._journal.calls(order))
            code, end = order.program.code, ProgramEnd.INTERRUPTED
            report = replace(report, program=ProgramTrace(code=code, calls=calls, end=end))
        await self._end(order, interrupted(report, reason, ctx))

    def _context(self) -> SkillContext:
        seen = self._journal.seen
        return SkillContext(self._latest_spec(), self._embodiment, self._world, seen)

    def _latest_spec(self) -> RobotSpec:
        """The robot's spec as it is registered now: somebody may have changed it."""
        return self._world.specs.get(self.spec.robot, self.spec)

    async def _execute(self) -> None:
        await self._orders_known.wait()
        for order in self._begun:
            if self._order_queue.resume(order):
                await self._carry_out(order, self._journal.calls(order))
            else:
                await self._end_interrupted(order)
        while True:
            self._state_publisher.set_activity(RobotActivity.IDLE)
            self._idle.set()
            await self._stops.released()
            order = await self._order_queue.next()
            self._idle.clear()
            await self._carry_out(order)

    async def _carry_out(
        self, order: Order, finished: tuple[FinishedCall, ...] | None = None
    ) -> None:
        """With the calls that had `finished`, an attempt goes on that an earlier run had begun."""
        with self._shared.leases.needed(order, self.incarnation, self._stops):
            while not await self._attempt(order, finished):
                finished = self._journal.calls(order)

    async def _attempt(self, order: Order, finished: tuple[FinishedCall, ...] | None) -> bool:
        """Whether the attempt has ended: a program that a stop has interrupted goes on."""
        released = await released_unless(self._order_queue.cancelled, self._stops)
        if not released and finished is None:
            reason = "the order was cancelled before it started"
            await self._end(
                order, make_report(order, self.incarnation, ReportState.CANCELLED, reason=reason)
            )
            return True
        ctx = self._context()
        try:
            work = self._work_of(order, ctx, finished or ())
        except (UnknownSkill, BadArguments) as error:
            refused, reason = ReportState.REFUSED, str(error)
            await self._end(
                order, make_report(order, self.incarnation, refused, reason, retryable=False)
            )
            return True
        report = make_report(
            order, self.incarnation, ReportState.STARTED, started_s=self._embodiment.now_s()
        )
        if finished is None:
            await self._disk.written(lambda: self._journal.started(order, report))
            self._outbox.wake()  # before anything moves
        self._state_publisher.set_activity(RobotActivity.BUSY, order)
        program = work if isinstance(work, ProgramRun) else None
        try:
            attempt = run_attempt(
                report,
                order.skill,
                work,
                now_s=self._embodiment.now_s,
                make_safe=lambda: make_safe(self._embodiment),
                deadline_s=order.deadline_s,
                cancelled=self._order_queue.cancelled,
                on_failure=ctx.observe_failure,
                most_tries=MOST_TRIES if program is None else 1,
                started_s=finished[0].call.started_s if finished else None,
            )
            ended = await unless_stopped(attempt, self._stops)
            if ended is None:
                return await self._after_stop(order, report, ctx, program)
            if ended.state is not ReportState.SUCCEEDED:
                await observe_what_is_left(ctx, order)
        except asyncio.CancelledError:
            reason = f"the worker of {self.spec.robot} was stopped while it did this"
            last = replace(interrupted(report, reason, ctx), leaving=True)
            self._end_if_there_is_room(order, traced(last, program))
            raise
        report = traced(replace(ended, facts=ctx.observed), program)
        try:
            # Others may go by the robot's state as soon as they have the report.
            await self._state_publisher.read_senses()
        except BaseException:
            self._end_if_there_is_room(order, report)
            raise
        await self._end(order, report)
        return True

    # --- emergency stops -------------------------------------------------------------------------

    async def _after_stop(
        self, order: Order, report: Report, ctx: SkillContext, program: ProgramRun | None
    ) -> bool:
        """Rest until the stop is over; see `_attempt`. What the attempt has come to is looked for
        then, as after a crash: a stopped robot may hold, or have dropped, what it was about."""
        held = self._stops.latest
        if not await released_unless(self._order_queue.cancelled, self._stops):
            await observe_what_is_left(ctx, order)
            cancelled, reason = ReportState.CANCELLED, "the order was cancelled during a stop"
            report = replace(
                report, state=cancelled, reason=reason, facts=ctx.observed,
                ended_s=self._embodiment.now_s(),
            )  # fmt: skip
            await self._end(order, traced(report, program))
            return True
        await make_safe(self._embodiment)
        if program is not None:
            return False
        await observe_after_crash(ctx, order)
        stops = tuple(stop.stop for stop in held.stops)
        report = replace(report, stops=stops, lapsed=held.lapsed)
        await self._end(order, interrupted(report, str(held), ctx))
        return True

    def _work_of(
        self, order: Order, ctx: SkillContext, finished: tuple[FinishedCall, ...]
    ) -> Callable[[], Awaitable[None]]:
        async def note(call: FinishedCall) -> None:
            await self._disk.written(lambda: self._journal.called(order, call))
            self._outbox.wake()

        def offered() -> tuple[str, ...]:
            return self._latest_spec().skills

        return work_of(order, ctx, self._registry, offered, self.incarnation, note, finished)

    async def _end(self, order: Order, report: Report) -> None:
        """Write the end of an attempt into the journal; its facts and report go out from there."""
        await self._disk.written(lambda: self._journal.ended(order, report))
        self._outbox.wake()

    def _end_if_there_is_room(self, order: Order, report: Report) -> None:
        """The same, where nobody waits for room; else the next run finds the attempt begun."""
        try:
            self._journal.ended(order, report)
        except sqlite3.Error as error:
            self._disk.found(error)
        else:
            self._outbox.wake()


async def _propagate(task: asyncio.Task[None]) -> None:
    """Wait for a task, so that what it raises is raised here, and leave it alone when cancelled."""
    await asyncio.shield(task)
