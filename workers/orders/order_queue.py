"""A robot's order queue: carries out what `fencing.decide` decides of each order."""

from __future__ import annotations

import asyncio
import logging
import sqlite3
import time
from collections import deque

from msgspec.structs import replace

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.full_disk import FullDisk
from keyexpr_schema.keyspace import ORDER, REPORT
from keyexpr_schema.payloads.tasks import (
    Order,
    OrderAddress,
    Report,
    ReportAddress,
    ReportState,
)
from keyexpr_schema.payloads.world import Fact
from keyexpr_schema.transport.session import Session
from workers.orders.fencing import (
    Accept,
    AttemptName,
    Cancel,
    Phase,
    Refuse,
    Renew,
    Repeat,
    decide,
    malformed,
    superseded,
)
from workers.orders.journal import Journal
from workers.orders.outbox import Outbox, make_report


class OrderQueue:
    """Orders as they come in; `next` hands out one at a time.

    `cancelled` is set while the order that was handed out last should be stopped.
    """

    def __init__(
        self,
        session: Session,
        journal: Journal,
        outbox: Outbox,
        robot: str,
        incarnation: str,
        disk: FullDisk,
    ) -> None:
        self.cancelled = asyncio.Event()
        self._disk = disk
        self._session = session
        self._journal = journal
        self._outbox = outbox
        self._incarnation = incarnation
        self._queue: deque[AttemptName] = deque()
        self._queued = asyncio.Event()
        self._running: AttemptName | None = None
        self._standing: dict[OrderAddress, AttemptName] = {}
        """What the orders that stand on their keys are about."""
        self._withdrawn: set[AttemptName] = set()
        """Attempts of an earlier run of the worker that were cancelled before they went on."""
        self._receiving = asyncio.Lock()
        self._without_room: dict[OrderAddress, Order] = {}
        """What stands on keys and could not be journaled yet."""
        self._all_standing_known = False
        self._log = logging.getLogger(f"robotfleet.worker.{robot}")

    async def next(self) -> Order:
        """The order that is to be carried out now; the one before it has ended."""
        self._running = None
        self.cancelled.clear()
        while not self._queue:
            self._queued.clear()
            await self._queued.wait()
        self._running = self._queue.popleft()
        return self._journal.ledger.attempts[self._running].order

    def resume(self, order: Order) -> bool:
        """Whether an attempt that an earlier run of the worker had begun may go on: its order still
        stands. It is then the one that `cancelled` is about."""
        name = AttemptName.of(order)
        if name in self._withdrawn or self._standing.get(OrderAddress.of(order)) != name:
            return False
        self._running = name
        self.cancelled.clear()
        return True

    async def receive(self, address: OrderAddress, order: Order | None) -> None:
        """Take in what stands on an order's key; `None`: nothing any more.

        What there is no room for is taken in by `receive_again`; a cancelled attempt is stopped all
        the same.
        """
        async with self._receiving:
            self._without_room.pop(address, None)
            if order is None:
                self._standing.pop(address, None)
                self._withdraw(address)
                self.forget_what_is_over()
            elif (wrong := malformed(order)) is not None:
                self._session.report_unusable(ORDER, address, order, wrong)
            else:
                await self._take_if_there_is_room(address, order)

    async def receive_again(self) -> None:
        """Take in what there was no room for, for ever."""
        while True:
            await asyncio.sleep(self._disk.retry_s)
            async with self._receiving:
                for address, order in list(self._without_room.items()):
                    await self._take_if_there_is_room(address, order)

    def all_received(self) -> None:
        """Every order that stood at the start has been received: what is missing is gone."""
        self._all_standing_known = True
        self.forget_what_is_over()

    def forget_what_is_over(self) -> None:
        """Let attempts go that have ended, were reported, and are ordered no more."""
        if self._all_standing_known:
            self._journal.forget(lambda name: name in self._standing.values())

    async def repeat_what_is_missing(self) -> None:
        """Say again how attempts ended that are still ordered, where the store has lost it."""
        for address, name in list(self._standing.items()):
            attempt = self._journal.ledger.attempts.get(name)
            if attempt is None or attempt.report is None or not self._journal.is_confirmed(name):
                continue
            missing = not await self._is_stored(attempt.report)
            if missing and self._standing.get(address) == name:  # it may have gone meanwhile
                again, age_s = self._again(attempt.report)
                await self._outbox.add(*again, age_s=age_s)

    def _withdraw(self, address: OrderAddress) -> None:
        of_task = [n for n in self._queue if (n.plan, n.task) == (address.plan, address.task)]
        for name in of_task:
            self._queue.remove(name)
            self._journal.dropped(name)

    async def _refuse_misplaced(self, address: OrderAddress, order: Order) -> None:
        here, there = ORDER.build(address), ORDER.build(OrderAddress.of(order))
        reason = f"the order at {here} says that it is the one at {there}"
        placed = replace(order, robot=address.robot, plan=address.plan, task=address.task)
        if AttemptName.of(placed) not in self._journal.ledger.attempts:
            await self._report_unless_stored(
                make_report(
                    placed, self._incarnation, ReportState.REFUSED, reason=reason, retryable=False
                )
            )

    async def _take_if_there_is_room(self, address: OrderAddress, order: Order) -> None:
        try:
            if OrderAddress.of(order) != address:
                await self._refuse_misplaced(address, order)
            else:
                self._standing[address] = AttemptName.of(order)
                await self._take(order)
        except sqlite3.Error as error:
            self._disk.found(error)
            self._without_room[address] = order
        else:
            if self._without_room.pop(address, None) is not None:
                self._disk.over()

    async def _take(self, order: Order) -> None:
        decision = decide(self._journal.ledger, order)
        name = AttemptName.of(order)
        if isinstance(decision, Accept):
            for older in superseded(self._journal.ledger, order):
                self._cancel(older, "a later attempt was ordered")
            self._journal.queued(order)
            self._queue.append(name)
            self._queued.set()
        elif isinstance(decision, Renew):
            self._journal.renewed(order)
        elif isinstance(decision, Cancel):
            if name in self._journal.ledger.attempts:
                self._hold_back(name)  # also where there is no room to note it
                self._journal.renewed(order)
                self._cancel(name)
            else:
                self._end_unstarted(order, "the order was cancelled before it started")
        elif isinstance(decision, Repeat):
            await self._report_unless_stored(decision.report)
        elif isinstance(decision, Refuse):
            refusal = make_report(
                order, self._incarnation, ReportState.REFUSED, reason=decision.reason
            )
            refusal = replace(refusal, fence=decision.fence)
            await self._report_unless_stored(refusal, or_any=True)
            self._log.warning("refuses %s of %s: %s", order.task, order.plan, decision.reason)

    def _cancel(self, name: AttemptName, why: str = "the order was cancelled") -> None:
        self._hold_back(name)
        attempt = self._journal.ledger.attempts[name]
        if attempt.phase is Phase.QUEUED and name != self._running:
            self._end_unstarted(attempt.order, f"{why} before it started")

    def _hold_back(self, name: AttemptName) -> None:
        """Stop an attempt that runs, do not start one that does not."""
        if name == self._running:
            self.cancelled.set()
        elif name in self._queue:
            self._queue.remove(name)
        elif self._journal.ledger.attempts[name].phase is Phase.STARTED:
            self._withdrawn.add(name)

    def _end_unstarted(self, order: Order, reason: str) -> None:
        report = make_report(order, self._incarnation, ReportState.CANCELLED, reason=reason)
        self._journal.ended(order, report)
        self._outbox.wake()

    async def _report_unless_stored(self, report: Report, *, or_any: bool = False) -> None:
        """Report what is no news to the journal, unless it stands there already."""
        if not await self._is_stored(report, or_any=or_any):
            again, age_s = self._again(report)
            self._journal.send(*again, age_s=age_s)
            self._outbox.wake()

    def _again(self, report: Report) -> tuple[tuple[Fact | Report, ...], float]:
        """What is sent of a report that the store has lost, perhaps with the facts that went before
        it; and how old that is [s]."""
        attempt = self._journal.ledger.attempts.get(AttemptName.of(report))
        if attempt is None or attempt.report != report or attempt.ended_wall_s is None:
            return (report,), 0.0
        return (*report.facts, report), max(0.0, time.time() - attempt.ended_wall_s)

    async def _is_stored(self, report: Report, *, or_any: bool = False) -> bool:
        """Whether a report stands there already.

        `or_any`: or any report of the attempt, which is truer than a refusal. A report that a newer
        planner of another lineage has for the same names stays, too.
        """
        address = ReportAddress.of(report)
        try:
            stored = await self._session.get(REPORT, address)
        except SchemaError as error:
            self._log.info("cannot see whether %s is known: %s", REPORT.build(address), error)
            return False
        if stored is None:
            return False
        if AttemptName.of(stored) != AttemptName.of(report):
            return stored.epoch > report.epoch
        if or_any and stored.state is not ReportState.REFUSED:
            return True
        return replace(stored, incarnation=report.incarnation, told=report.told) == report
