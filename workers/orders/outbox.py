"""Reports on their way: made of orders, sent in order until each is read back from the store."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from msgspec.structs import replace

from keyexpr_schema.errors import Overtaken, SchemaError, UndecodablePayload, WriteRefused
from keyexpr_schema.full_disk import FullDisk
from keyexpr_schema.keyspace import FACT, REPORT
from keyexpr_schema.payloads.tasks import Order, Report, ReportAddress, ReportState
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.session import Session
from workers.orders.journal import Journal, Unsent

CONFIRM_S = 10.0
AGAIN_S = 10.0
"""After that it is tried again to write what is beyond a limit of the store."""
AT_ONCE = 50
"""So many of these may be refused one after the other, before that is left for the next time."""
PAUSE_S = 0.5
"""Wall seconds before the next go when a write was not confirmed though a router is there."""


def make_report(
    order: Order,
    incarnation: str,
    state: ReportState,
    reason: str | None = None,
    *,
    retryable: bool = True,
    started_s: float | None = None,
) -> Report:
    """What the run `incarnation` of a worker reports of the attempt that `order` asks for."""
    return Report(
        robot=order.robot,
        plan=order.plan,
        revision=order.revision,
        task=order.task,
        attempt=order.attempt,
        epoch=order.epoch,
        incarnation=incarnation,
        state=state,
        reason=reason,
        retryable=retryable,
        started_s=started_s,
        planner=order.planner,
    )


def _shortened(report: Report, why: str) -> tuple[Report, Report]:
    """A report without what was done on the way, and then without what was seen, too: of a success
    whose facts nobody hears, a planner believes that all went as it was planned."""
    said = f"the worker could report no more than that: {why}"
    without_tries = replace(report, tries=(), program=None, reason=said)
    return without_tries, replace(without_tries, facts=(), started_s=None, ended_s=None)


class Outbox:
    """The one sender of a worker's facts and reports.

    The journal is the queue, so that nothing is lost when the worker or the router goes down, and
    an attempt's facts are in the store before its report is: but for those that the store has no
    room for, which wait beside the queue, and are tried again when nothing else is to be sent.
    """

    def __init__(
        self,
        session: Session,
        journal: Journal,
        disk: FullDisk,
        again_s: float = AGAIN_S,
        on_refused: Callable[[str | None], None] = lambda _: None,
    ) -> None:
        """`on_refused` hears why the store does not take a report in, and None once it does."""
        self._again_s = again_s
        self._on_refused = on_refused
        self._session = session
        self._journal = journal
        self._disk = disk
        self._more = asyncio.Event()
        self._empty = asyncio.Event()
        self._log = logging.getLogger("robotfleet.worker.outbox")

    def wake(self) -> None:
        """There is something new in the journal."""
        self._empty.clear()
        self._more.set()

    async def add(self, *payloads: Fact | Report, age_s: float = 0.0) -> None:
        """Send these, which are so old, once they are in the journal, after all that is."""
        await self._disk.written(lambda: self._journal.send(*payloads, age_s=age_s))
        self.wake()

    async def emptied(self, within_s: float | None = None) -> bool:
        """Wait until everything has been read back from the store; whether it was in that time."""
        with suppress(TimeoutError):
            async with asyncio.timeout(within_s):
                await self._empty.wait()
                return True
        return False

    async def run(self) -> None:
        """Send for ever; ends by being cancelled."""
        said = ""
        while True:
            self._more.clear()
            while (unsent := self._journal.unsent()) is not None:
                try:
                    await self._send_or_skip(unsent)
                except SchemaError as error:
                    if said != (said := str(error)):  # a report may be refused for days
                        self._log.warning("not confirmed yet, tries again: %s", error)
                        if isinstance(error, WriteRefused):
                            self._on_refused(str(error))
                    await self._session.wait_connected()
                    await asyncio.sleep(PAUSE_S)
                    continue
                if said:
                    said = ""
                    self._on_refused(None)
                self._journal.sent(unsent.number)
            self._empty.set()
            try:
                async with asyncio.timeout(self._again_s if self._journal.refused else None):
                    await self._more.wait()
            except TimeoutError:
                with suppress(SchemaError):  # there is no store now
                    await self.try_again()

    async def try_again(self) -> None:
        """Send what waits for room, as long as there is some, and nothing else to be sent; who is
        refused holds up few others.

        Raises:
            SchemaError: it was not confirmed.
        """
        waiting = self._journal.refused
        may_fail = min(AT_ONCE, len(waiting))
        while may_fail and not self._more.is_set() and (waits := waiting.next()):
            try:
                await self._send_fact(Unsent(0, *waits), again=True)
            except WriteRefused:
                may_fail -= 1

    async def _send_or_skip(self, unsent: Unsent) -> None:
        """Send it. A fact that the store does not take in holds up no report, which has it too, and
        what nobody could ever read of a report holds up neither what came of the attempt nor all
        that is reported later."""
        if isinstance(unsent.payload, Fact):
            with suppress(WriteRefused):
                await self._send_fact(unsent)
            return
        report, number, age_s = unsent.payload, unsent.number, unsent.age_s
        if (why := await self._refused_for_good(unsent)) is None:
            return
        shorter, shortest = _shortened(report, why)
        if await self._refused_for_good(Unsent(number, shorter, age_s)) is not None:
            await self._send(Unsent(number, shortest, age_s))
        self._log.error(
            "not all of what %s has to report of %s was sent: %s", report.robot, report.task, why
        )

    async def _refused_for_good(self, unsent: Unsent) -> str | None:
        """Send it; why nobody would ever take it in, if so."""
        try:
            await self._send(unsent)
        except (WriteRefused, UndecodablePayload) as error:
            if isinstance(error, WriteRefused) and not error.lasting:
                raise
            return str(error)
        return None

    async def _send_fact(self, unsent: Unsent, *, again: bool = False) -> None:
        """Send a fact, or have it wait until there is room; `again`: it has waited for that.

        Raises:
            WriteRefused: there is none.
        """
        fact, refused = unsent.payload, self._journal.refused
        assert isinstance(fact, Fact)
        try:
            await self._send(unsent)
        except (WriteRefused, UndecodablePayload) as error:
            if isinstance(error, WriteRefused) and not error.lasting:
                if not again:
                    self._log.warning("not sent yet, tries again now and then: %s", error)
                lost = await self._disk.written(partial(refused.keep, fact, unsent.age_s))
                if lost is not None:
                    self._log.error("%s is not tried again: too many facts wait", lost.key)
                raise
            self._log.error("not sent, and not tried again: %s", error)
        refused.drop(fact.key)

    async def _send(self, unsent: Unsent) -> None:
        """Have it confirmed, as of when it was noted: what others saw since goes before a fact that
        comes late; what was on its way for long, and this worker knew of, does not."""
        payload, age_s = unsent.payload, unsent.age_s
        if isinstance(payload, Fact):
            address = FactAddress.of(payload.key)
            try:
                await self._session.confirm(FACT, address, payload, CONFIRM_S, age_s=age_s)
            except Overtaken:
                if await self._was_known(payload):
                    with suppress(Overtaken):
                        await self._session.confirm(FACT, address, payload, CONFIRM_S)
        else:
            if payload.told and any(fact in self._journal.refused for fact in payload.facts):
                payload = replace(payload, told=False)  # who reads it hears them of nobody else
            reported = ReportAddress.of(payload)
            try:
                await self._session.confirm(REPORT, reported, payload, CONFIRM_S, age_s=age_s)
            except Overtaken:  # it was deleted since, and is wanted again
                await self._session.confirm(REPORT, reported, payload, CONFIRM_S)

    async def _was_known(self, fact: Fact) -> bool:
        """Whether the worker knew what the store has when it noted `fact`: its own earlier word, by
        its own clock, perhaps of an earlier run, or the very belief that it found wrong (see
        `SkillContext.observe`), which passed here before the store had received it."""
        try:
            there = await self._session.get(FACT, FactAddress.of(fact.key))
        except UndecodablePayload:
            return True  # nobody can read it
        if there is None:
            return False
        if fact.value is None and there.value is not None and there.time_s == fact.time_s:
            return True
        return there.source == fact.source and there.time_s < fact.time_s
