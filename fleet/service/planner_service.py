"""The planner service: keys become events, events go through the core, effects are carried out."""

from __future__ import annotations

import asyncio
import logging
import time
import uuid
from collections.abc import Sequence
from contextlib import AsyncExitStack
from typing import Any

from msgspec.structs import replace

from fleet.core import events
from fleet.core.dispatch.dispatcher import next_timer
from fleet.core.effects import Archive as ToArchive
from fleet.core.effects import DropJob, Effect, Interpret, MakePlan, Publish, Retract, effects_of
from fleet.core.events import At, Event
from fleet.core.model.skills import Skills, phrases_of
from fleet.core.state import LOGIC, Policy, State
from fleet.core.step import step
from fleet.errors import Superseded
from fleet.history.archive import Archive
from fleet.history.retention import Retention
from fleet.service.catch_up import prior_state, stale_documents, until_synced
from fleet.service.event_journal import EventJournal
from fleet.service.event_translation import WATCHED, event_of, missed_deletions
from fleet.service.fleet_clock import FleetClock
from fleet.service.outbox import Outbox
from fleet.service.past import Past
from fleet.service.planning.pool import PlanningPool
from keyexpr_schema.keyspace import (
    PLANNER_ALIVE,
    PLANNER_STATUS,
    ROBOT_ALIVE,
    SIM_CLOCK,
    SIM_SCENE,
)
from keyexpr_schema.payloads.system import PlannerAddress, PlannerAliveAddress, PlannerStatus
from keyexpr_schema.transport.session import Session, TokenWatch, Watch

log = logging.getLogger(__name__)
CHARGE_S = 3600.0
"""How long a planner that starts waits for a store."""


class PlannerService:
    """One run of the central planner over a session, with its journal."""

    def __init__(
        self,
        session: Session,
        journal: EventJournal,
        pool: PlanningPool,
        skills: Skills,
        archive: Archive,
        policy: Policy,
        retention: Retention | None = None,
    ) -> None:
        """`pool` is running; `skills` are the models that are planned with."""
        self._session = session
        self._journal = journal
        self._pool = pool
        self._skills = dict(skills)
        self._policy = replace(policy, skill_phrases=phrases_of(skills))
        self._incarnation = uuid.uuid4().hex[:12]
        self._state = State()
        self._clock = FleetClock()
        self._outbox = Outbox(session)
        self._past = Past(
            session, archive, self._outbox, retention or Retention(), lambda: self._state
        )
        self._inbox: asyncio.Queue[Event] = asyncio.Queue()
        self._held: list[Effect] | None = []
        """Effects held back until everything stored is known; afterwards `None`."""

    @property
    def state(self) -> State:
        """What the planner knows now."""
        return self._state

    async def run(self, ready: asyncio.Event | None = None) -> None:
        """Plan until cancelled; sets `ready` once everything that is stored was taken in.

        Raises:
            Superseded: a planner with a higher epoch is in charge.
        """
        number, snapshot = self._journal.snapshot()
        if not snapshot.skills:  # in journals of earlier versions no event brings them
            snapshot = replace(snapshot, skills=self._skills)
        first_run = self._journal.empty
        self._state = self._replayed(number, snapshot)
        async with AsyncExitStack() as stack:
            watch = await stack.enter_async_context(
                self._session.watch(*WATCHED, SIM_CLOCK, PLANNER_STATUS)
            )
            tokens = await stack.enter_async_context(self._session.watch_tokens(ROBOT_ALIVE))
            await stack.enter_async_context(self._outbox.running())
            await stack.enter_async_context(self._past.running())
            scenes = await self._session.list(SIM_SCENE)
            self._clock.resume(self._state.time_s, bool(scenes))
            if first_run:
                self._apply(await prior_state(self._session, self._at()))
            await self._take_charge()
            await stack.enter_async_context(
                self._session.token(PLANNER_ALIVE, PlannerAliveAddress(self._incarnation))
            )
            await self._catch_up(watch, tokens)
            stale = await stale_documents(self._session, self._state)
            self._go_live()
            self._carry_out(stale)
            if ready is not None:
                ready.set()
            try:
                async with asyncio.TaskGroup() as tasks:
                    tasks.create_task(self._listen(watch))
                    tasks.create_task(self._watch_workers(tokens))
                    tasks.create_task(self._take_events())
                    tasks.create_task(self._take_answers())
                    tasks.create_task(self._past.delete_keys_in_time())
            except* Superseded as group:
                raise group.exceptions[0] from None

    def _replayed(self, number: int, snapshot: State) -> State:
        """The state after all that is journaled; what became over on the way is archived, if an
        earlier run was killed before it could."""
        state = snapshot
        self._past.keep(ToArchive(record) for record in snapshot.over)
        for event in self._journal.events(number):
            state, effects = step(state, event)
            self._past.keep(effects)
        return state

    def _at(self) -> At:
        return self._clock.at()

    async def _take_charge(self) -> None:
        """Take the next epoch: no two planners ever have the same, however they were started.

        What is there that is no status counts for nothing: it must not keep a planner from
        starting.
        """
        parts = await self._pool.ready()

        def next_epoch(status: PlannerStatus | None) -> PlannerStatus:
            return PlannerStatus(
                epoch=1 + max(self._state.epoch, status.epoch if status else 0),
                incarnation=self._incarnation,
                planners=tuple(parts.planners_wait_s),
                strategies=parts.strategies,
                allocators=tuple(parts.allocators_wait_s),
                skills=tuple(self._skills),
            )

        ours = await self._session.update(
            PLANNER_STATUS, PlannerAddress(), next_epoch, timeout_s=CHARGE_S
        )
        self._apply(
            events.PlannerStarted(
                epoch=ours.epoch,
                incarnation=self._incarnation,
                policy=self._policy,
                skills=self._skills,
                logic=LOGIC,
                lineage=self._incarnation,
                **self._at(),
            )
        )

    async def _catch_up(self, watch: Watch, tokens: TokenWatch[Any]) -> None:
        """Hear of everything stored, and of what went away while no planner was there."""
        seen: set[str] = set()
        async for change in until_synced(watch):
            seen.add(change.key.build(change.address))
            self._on_change(change)
        for event in missed_deletions(self._state, seen, self._at()):
            self._apply(event)
        here: set[tuple[str, str]] = set()
        async for token in until_synced(tokens):
            self._on_token(token)
            if token.alive:
                here.add((token.address.robot, token.address.incarnation))
        for robot, runs in self._state.connected.items():
            for run in runs:
                if (robot, run) not in here:
                    self._apply(
                        events.WorkerDisconnected(robot=robot, incarnation=run, **self._at())
                    )

        while not self._inbox.empty():
            self._apply(self._inbox.get_nowait())

    def _go_live(self) -> None:
        """From now on effects are carried out; those of the catching up all at once.

        Until here nothing was ordered, since a report that is not read yet could forbid it.
        """
        held = [e for e in self._held or () if isinstance(e, Publish | Retract)]
        self._held = None
        self._past.publish_unsettled()
        self._carry_out((*held, *effects_of(self._state)))

    async def _listen(self, watch: Watch) -> None:
        async for change in watch:
            self._on_change(change)

    def _on_change(self, change: Any) -> None:
        if change.key is SIM_CLOCK:
            if change.value is not None:
                self._clock.ticked(change.value.time_s)
        elif change.key is PLANNER_STATUS:
            other = change.value
            if other is not None and other.epoch > self._state.epoch:
                raise Superseded(
                    f"planner {other.incarnation} took charge of realm "
                    f"{self._session.config.realm} (epoch {other.epoch}); this one stops"
                )
        elif (event := event_of(change, self._at())) is not None:
            if self._held is None and isinstance(event, events.ReportReceived):
                report = event.report
                self._clock.reported(report.ended_s or report.started_s or 0.0)
            self._inbox.put_nowait(event)

    async def _watch_workers(self, tokens: TokenWatch[Any]) -> None:
        async for token in tokens:
            self._on_token(token)

    def _on_token(self, token: Any) -> None:
        kind = events.WorkerConnected if token.alive else events.WorkerDisconnected
        robot, incarnation = token.address.robot, token.address.incarnation
        self._inbox.put_nowait(kind(robot=robot, incarnation=incarnation, **self._at()))

    async def _take_events(self) -> None:
        """Take events one after the other; wake up when a timer of the state runs out."""
        while True:
            timer = next_timer(self._state)
            try:
                async with asyncio.timeout(None if timer is None else timer - time.monotonic()):
                    event = await self._inbox.get()
            except TimeoutError:
                event = events.TimerFired(**self._at())
            self._apply(event)

    def _apply(self, event: Event) -> None:
        if (news := self._past.news(event)) is None:
            return
        state, effects = step(self._state, news)
        if state is self._state:
            return
        self._journal.append(news, state)
        self._past.keep(effects)
        self._state = state
        self._carry_out(effects)

    def _carry_out(self, effects: Sequence[Effect]) -> None:
        if self._held is not None:
            self._held.extend(effects)
            return
        self._outbox.send(e for e in effects if isinstance(e, Publish | Retract))
        self._past.sent(effects)
        for effect in effects:
            if isinstance(effect, MakePlan | Interpret):
                self._pool.submit(effect.given)
            elif isinstance(effect, DropJob):
                self._pool.drop(effect.job)

    async def _take_answers(self) -> None:
        """Answers of planning jobs are events of the moment at which they come."""
        while True:
            answer = await self._pool.answers.get()
            self._inbox.put_nowait(replace(answer, **self._at()))
