"""What is over, at the planner's shell: archived at once, and answered for later.

The core forgets what is over in the event that ends it. But keys say again what they said, when a
planner starts or a link comes back, and people ask about plans of yesterday. So an event is shown
to the archive first: a request that was answered and a goal that was reached are no news, and who
asks something of a plan that ended hears so from here, not from the core.
"""

from __future__ import annotations

import asyncio
import logging
import sqlite3
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable
from contextlib import asynccontextmanager
from typing import Any

from fleet.core import events
from fleet.core.effects import Archive as ToArchive
from fleet.core.effects import Effect, Retract, documents_of
from fleet.core.events import Event
from fleet.core.standing import part_name
from fleet.core.state import State
from fleet.history.archive import Archive
from fleet.history.inheritance import inherited
from fleet.history.retention import Retention, Retirement
from fleet.service.history_questions import HistoryQuestions, rejected
from fleet.service.outbox import Outbox
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.full_disk import FullDisk
from keyexpr_schema.key import Address
from keyexpr_schema.keyspace import (
    GOAL_STATUS,
)
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.history import (
    Ended,
    PastEntry,
    PlanRecord,
    RequestRecord,
    Retired,
    RetireQuery,
)
from keyexpr_schema.payloads.plans import PlanState, PlanStatus
from keyexpr_schema.payloads.requests import (
    Answer,
    Control,
    ControlRequest,
    PlanRequest,
    ReplanRequest,
)
from keyexpr_schema.transport.session import Session

Request = PlanRequest | ReplanRequest | ControlRequest
SETTLE_S = 5.0
RETRY_S = 0.5

log = logging.getLogger(__name__)


class Past:
    """What one run of the planner does about what is over."""

    def __init__(
        self,
        session: Session,
        archive: Archive,
        outbox: Outbox,
        retention: Retention | None,
        state: Callable[[], State],
        disk: FullDisk,
        on_request: Callable[[Event], None],
        on_retired: Callable[[RetireQuery, Retired], None],
    ) -> None:
        """`on_request` hears of what people want of what is over, and the core never does,
        `on_retired` of the keys that they have had deleted."""
        self._on_request = on_request
        self._session, self._archive, self._outbox = session, archive, outbox
        self._disk = disk
        self._state = state
        self._retirement = Retirement(
            session, archive, retention or Retention(), lambda *which: rejected(state(), *which)
        )
        self._questions = HistoryQuestions(
            session, archive, self._retirement, state, self._settled, on_retired
        )
        self._tasks: set[asyncio.Task[None]] = set()
        self._settling: set[asyncio.Task[None]] = set()
        self._to_delete: dict[str, dict[str, events.ControlRequested]] = {}
        """Requests, by plan and name, to delete plans that are about to be over."""

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Tell of what is over, and do what is asked about it, until the block ends."""
        async with self._questions.answered():
            try:
                yield
            finally:
                tasks = list(self._tasks)
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)

    async def delete_keys_in_time(self) -> None:
        """Delete keys when what they are about has been over for long, for ever."""
        while True:
            try:
                await self._retirement.run()
            except sqlite3.Error as error:
                self._disk.found(error)
                await asyncio.sleep(self._disk.retry_s)

    def _in_background(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    # --- what becomes over -----------------------------------------------------------------------

    def keep(self, effects: Iterable[Effect]) -> None:
        """Archive what is over by these effects; it is on disk when this returns."""
        if records := _records(effects):
            self._archive.add(records)

    def sync(self) -> None:
        """Before a snapshot that knows nothing of it is kept: what is over outlives a power cut."""
        self._archive.sync()

    async def inherit(self, wall_time_s: float) -> None:
        """Archive what an earlier planner left on the keys, and is over."""
        self._archive.add(await inherited(self._session, wall_time_s))

    def has(self, address: Address) -> bool:
        """Whether a key is about something that is over and still has its keys."""
        plan, goal = getattr(address, "plan", None), getattr(address, "goal", None)
        if plan is not None:
            return self._archive.live_plan(plan) is not None
        return goal is not None and self._archive.goal(goal) is not None

    def sent(self, effects: Iterable[Effect]) -> None:
        """These effects are with the outbox: note when the keys of what is over are as they are
        to stay."""
        for record in _records(effects):
            self._settle_soon(record)

    def publish_unsettled(self) -> None:
        """What ended shortly before an earlier run did: its keys may not say so yet."""
        for record in self._archive.unsettled():
            self._publish(record)

    def _publish(self, record: Ended) -> None:
        self._outbox.send(documents_of(record))
        self._settle_soon(record)

    def _forget_parts_of(self, goal: str, state: State) -> None:
        """Parts and runs of an earlier goal of this name give way to those that it will have, which
        are called the same."""
        if goal in state.goal_states:  # it goes on counting
            return
        for part in self._archive.live_goals_like(part_name(goal, "[0-9]*")):
            if part not in state.goals:
                self._forget_goal(part)

    def _forget_goal(self, goal: str) -> None:
        self._archive.retire_goal(goal)
        self._outbox.send([Retract(GOAL_STATUS, GoalAddress(goal))])

    def _settle_soon(self, record: Ended) -> None:
        task = self._in_background(self._settle(record))
        self._settling.add(task)
        task.add_done_callback(self._settling.discard)
        if isinstance(record, PlanRecord):
            for event in self._to_delete.pop(record.spec.plan, {}).values():
                self._in_background(self._delete(event.request, event))

    async def _settle(self, record: Ended) -> None:
        await self._outbox.written(d.key.build(d.address) for d in documents_of(record))
        await self._disk.written(lambda: self._archive.settle(record))
        self._retirement.wake()

    # --- what is said about it -------------------------------------------------------------------

    def news(self, event: Event) -> Event | None:
        """The event, if it is about something that is not over; else it is dealt with."""
        state = self._state()
        match event:
            case events.GoalPut() if event.goal.goal not in state.goals:
                known = self._archive.goal(event.goal.goal)
                if known is not None and known.wants_same(event.goal):
                    return None
                if known is not None:  # its keys are a new goal's now
                    self._archive.retire_goal(event.goal.goal)
                self._forget_parts_of(event.goal.goal, state)
            case events.SchedulePut() if event.schedule.schedule not in state.goals:
                self._forget_parts_of(event.schedule.schedule, state)
            case events.GoalDeleted() if event.goal not in state.goals:
                if not self._retirement.deletes(event.goal) and self._archive.goal(event.goal):
                    self._on_request(event)
                    self._forget_goal(event.goal)
            case events.ScheduleDeleted() if event.schedule not in state.goals:
                if self._archive.goal(event.schedule):
                    self._forget_goal(event.schedule)
            case events.PlanProposed() if event.plan.plan not in state.plans:
                past = self._archive.plan(event.plan.plan)
                if past is None:
                    return event
                if self._archive.live_plan(event.plan.plan) is None:
                    self._on_request(event)
                    self._reject(event, past)
                return None
            case events.PlanRequested() | events.ReplanRequested() | events.ControlRequested():
                ask = event.request
                if self._archive.answered(ask.request):
                    return None
                if self._deal_with(ask, event, state):
                    self._on_request(event)
                    return None
                if isinstance(event, events.ControlRequested) and _soon_deletable(state, ask):
                    self._on_request(event)
                    self._to_delete.setdefault(event.request.plan, {})[ask.request] = event
                    return None
            case _:
                pass
        return event

    def _deal_with(self, ask: Request, event: Event, state: State) -> bool:
        """Answer a request that is about something that is over; whether it is."""
        over = ask.plan is not None and ask.plan not in state.plans
        past = self._archive.plan(ask.plan) if over and ask.plan is not None else None
        if past is not None and isinstance(ask, ControlRequest) and ask.control is Control.DELETE:
            self._in_background(self._delete(ask, event))
            return True
        if (refusal := self._refusal(ask, past, event.wall_time_s, state)) is None:
            return False
        self._answer(ask, event, False, refusal)
        return True

    def _refusal(
        self, ask: Request, past: PastEntry | None, now_s: float, state: State
    ) -> str | None:
        if isinstance(ask, PlanRequest):
            if past is not None:
                return _name_is_used(past, now_s)
        elif past is not None:
            why = f" ({past.reason})" if past.reason else ""
            return f"plan {ask.plan} is not running: it {ended(past, now_s)}{why}"
        for goal in () if isinstance(ask, ControlRequest) else ask.goals:
            known = None if goal in state.goals else self._archive.past_goal(goal)
            if known is not None:
                reason = f": {known.reason}" if known.reason else ""
                return f"goal {goal} is {known.outcome.value}{reason}"
        return None

    def _reject(self, event: events.PlanProposed, past: PastEntry) -> None:
        """Say of a proposal that its name has been used: nothing of it is ever carried out."""
        plan, at_s, at_wall_s = event.plan, event.time_s, event.wall_time_s
        status = PlanStatus(
            plan=plan.plan,
            revision=plan.revision,
            state=PlanState.REJECTED,
            goals=plan.goals,
            reason=_name_is_used(past, at_wall_s),
            time_s=at_s,
        )
        record = PlanRecord(
            spec=plan,
            status=status,
            begun_s=at_s,
            begun_wall_s=at_wall_s,
            ended_s=at_s,
            ended_wall_s=at_wall_s,
        )
        self._archive.add([record])
        self._publish(record)

    def _answer(self, ask: Request, event: Event, accepted: bool, sentence: str) -> None:
        record = RequestRecord(
            answer=Answer(request=ask.request, accepted=accepted, sentence=sentence),
            ended_s=event.time_s,
            ended_wall_s=event.wall_time_s,
        )
        self._archive.add([record])
        self._publish(record)

    async def _delete(self, ask: ControlRequest, event: Event) -> None:
        """Delete the keys of a plan that is over; until they are, the request has no answer."""
        await self._settled()
        while (live := self._archive.live_plan(ask.plan)) is not None:
            try:
                await self._retirement.end([live])
            except SchemaError as error:
                log.warning("plan %s is not deleted yet: %s", ask.plan, error)
                await asyncio.sleep(RETRY_S)
        self._answer(ask, event, True, f"plan {ask.plan} is deleted")

    async def _settled(self) -> None:
        """Wait, for a while, until the keys of what is over have their last values."""
        if self._settling:
            await asyncio.wait(tuple(self._settling), timeout=SETTLE_S)


def _soon_deletable(state: State, ask: Request) -> bool:
    """Whether somebody wants a plan deleted that is being given up, and is over as soon as robots
    that are there have said how they left off. Until then, the request has no answer."""
    if not (isinstance(ask, ControlRequest) and ask.control is Control.DELETE):
        return False
    entry = state.plans.get(ask.plan)
    if entry is None or not (entry.cancelling or entry.ended):
        return False
    return all(record.robot in state.connected for record in entry.outstanding())


def _records(effects: Iterable[Effect]) -> list[Ended]:
    return [effect.record for effect in effects if isinstance(effect, ToArchive)]


def ended(past: PastEntry, now_wall_s: float) -> str:
    """How a plan ended and how long that is ago: `succeeded 12 s ago`."""
    outcome = past.outcome.value
    verb = outcome if outcome in ("succeeded", "failed") else f"was {outcome}"
    return f"{verb} {_span(now_wall_s - past.ended_wall_s)} ago"


def _span(span_s: float) -> str:
    for unit_s, unit in ((172_800.0, "days"), (7200.0, "h"), (120.0, "min")):
        if span_s >= unit_s:
            in_s = {"days": 86_400.0, "h": 3600.0, "min": 60.0}[unit]
            return f"{span_s / in_s:.0f} {unit}"
    return f"{max(0.0, span_s):.0f} s"


def _name_is_used(past: PastEntry, now_s: float) -> str:
    """Why a plan cannot be called so: its orders would be those of the one before."""
    return (
        f"there has been a plan {past.plan} already: it {ended(past, now_s)}; choose another name"
    )
