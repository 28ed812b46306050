"""The planner service: keys become events, events go through the core, effects are carried out."""

from __future__ import annotations

import asyncio
import logging
import sqlite3
import uuid
from collections.abc import Collection, Sequence
from contextlib import AsyncExitStack
from functools import partial
from typing import Any

from msgspec.structs import replace

from fleet.core import answering, events
from fleet.core.effects import DropJob, Effect, Interpret, MakePlan, Publish, Retract, effects_of
from fleet.core.events import Event
from fleet.core.model.skills import Skills, phrases_of, relations_of_skills, state_words_of
from fleet.core.named_tasks import tasks_known
from fleet.core.state import LOGIC, Policy, State
from fleet.errors import FleetError, Superseded
from fleet.history.archive import Archive
from fleet.history.audit_log import AuditLog
from fleet.history.retention import Retention
from fleet.service.audit_trail import AuditTrail
from fleet.service.catch_up import (
    in_order,
    known_keys,
    open_plans,
    outdated,
    prior_state,
    stale_documents,
    until_synced,
)
from fleet.service.charge import Charge
from fleet.service.diagnostics import Diagnostics
from fleet.service.event_journal import EventJournal
from fleet.service.event_translation import WATCHED
from fleet.service.fleet_clock import FleetClock
from fleet.service.incoming import Incoming
from fleet.service.journaled_core import JournaledCore
from fleet.service.leases import Leases
from fleet.service.outbox import Outbox
from fleet.service.over_closures import over_closures
from fleet.service.past import Past
from fleet.service.planning.pool import PlanningPool
from fleet.service.put_back import putting_back
from fleet.service.reconciliation import Reconciliation
from fleet.service.recovery import Recovered
from fleet.service.set_back import recovered
from keyexpr_schema.facts import FactKey
from keyexpr_schema.full_disk import FullDisk, is_full
from keyexpr_schema.keyspace import (
    DELETION,
    FACT,
    LEASE,
    PLANNER_ALIVE,
    PLANNER_STATUS,
    QUESTION,
    REPORT,
    ROBOT_ALIVE,
    SIM_CLOCK,
    SIM_SCENE,
    TASKS_KNOWN,
)
from keyexpr_schema.payloads.methods import TasksQuery, TasksReply
from keyexpr_schema.payloads.questions import QuestionQuery, QuestionReply
from keyexpr_schema.payloads.system import PlannerAddress, PlannerAliveAddress
from keyexpr_schema.payloads.world import FactAddress
from keyexpr_schema.transport.session import Narrowed, Session, TokenWatch, Watch

SNAPSHOT_CHECK_S = 0.5
TOGETHER = 64
"""Events whose effects wait for one sync of the journal, at most."""

log = logging.getLogger(__name__)


class PlannerService:
    """One run of the central planner over a session, with its journal."""

    def __init__(
        self,
        session: Session,
        journal: EventJournal,
        pool: PlanningPool,
        skills: Skills,
        archive: Archive,
        audit: AuditLog,
        policy: Policy,
        retention: Retention | None = None,
    ) -> None:
        """`pool` is running; `skills` are the models that are planned with."""
        self._session = session
        self._journal = journal
        self._pool = pool
        self._skills = dict(skills)
        self._policy = replace(
            policy,
            skill_phrases=phrases_of(skills),
            state_words=state_words_of(skills),
            relations=relations_of_skills(skills),
        )
        self._incarnation = uuid.uuid4().hex[:12]
        self._charge = Charge(
            session, self._incarnation, tuple(skills), lambda: self._core.state.epoch
        )
        self._leases = Leases(session, self._incarnation, policy.lease_s, self._charge.not_said)
        self._clock = FleetClock()
        self._outbox = Outbox(session)
        self._reconciliation = Reconciliation(session, self._outbox, lambda: self._core.state)
        self._diagnostics = Diagnostics(session, self._outbox)
        self._core = JournaledCore(journal, self._diagnostics.set_aside)
        idle = "nothing new is planned or ordered"
        self._disk = FullDisk(archive.path.parent, "the planner", idle, self._diagnostics.disk)
        self._audit = AuditTrail(session, audit, self._outbox)
        self._past = Past(
            session,
            archive,
            self._outbox,
            retention or Retention(),
            lambda: self._core.state,
            self._disk,
            self._audit.heard,
            lambda query, gone: self._audit.retired(query, gone, **self._clock.at()),
        )
        self._incoming = Incoming(
            lambda: self.state,
            self._clock,
            self._charge,
            self._leases,
            self._audit,
            self._diagnostics.limits,
        )
        self._held: list[Effect] | None = []
        """Effects held back until everything stored is known; afterwards `None`."""

    @property
    def state(self) -> State:
        """What the planner knows now."""
        return self._core.state

    async def run(self, ready: asyncio.Event | None = None) -> None:
        """Plan until cancelled; sets `ready` once everything that is stored was taken in.

        Raises:
            Superseded: a planner with a higher epoch is in charge.
            sqlite3.Error, OSError: what it keeps can be read or written no more.
        """
        known = self._skills, self._past.keep, self._audit.replayed
        recover = partial(self._core.recover, *known)
        found, first_run = await recovered(self._session, self._journal, self._past.has, recover)
        async with AsyncExitStack() as stack:
            await stack.enter_async_context(self._outbox.running())
            await stack.enter_async_context(self._past.running())
            await stack.enter_async_context(self._audit.answered())
            await stack.enter_async_context(self._session.serve(QUESTION, self._answered))
            await stack.enter_async_context(self._session.serve(TASKS_KNOWN, self._tasks_known))
            await stack.enter_async_context(self._session.serve(LEASE, self._leases.give))
            scenes = await self._session.list(SIM_SCENE)
            self._clock.resume(self.state.time_s, bool(scenes))
            if first_run:  # before the watch: it asks for the reports of the plans that are open
                await self._past.inherit(self._clock.at()["wall_time_s"])
                self._apply(await prior_state(self._session, self._clock.at()))
            watch = await stack.enter_async_context(
                self._session.watch(
                    *(key for key in WATCHED if key is not REPORT),
                    Narrowed(REPORT, "plan", lambda: open_plans(self.state)),
                    SIM_CLOCK,
                    PLANNER_STATUS,
                    DELETION,
                    known=known_keys(self.state, found.concluded),
                    on_trouble=self._diagnostics.store,
                    in_order=True,
                    on_lost=putting_back(lambda: self.state, self._carry_out),
                )
            )
            tokens = await stack.enter_async_context(self._session.watch_tokens(ROBOT_ALIVE))
            await self._take_charge(first_run)
            await stack.enter_async_context(
                self._session.token(PLANNER_ALIVE, PlannerAliveAddress(self._incarnation))
            )
            await self._catch_up(watch, tokens, found.concluded)
            stale = await stale_documents(
                self._session, self.state, self._past.has, all_of_them=first_run
            )
            await self._diagnostics.start()
            self._go_live(found)
            self._carry_out(stale)
            if ready is not None:
                ready.set()
            try:
                async with asyncio.TaskGroup() as tasks:
                    tasks.create_task(self._charge.keep(self._pool.ready, self._epoch_raised))
                    tasks.create_task(self._leases.keep_charge())
                    tasks.create_task(self._listen(watch))
                    tasks.create_task(self._watch_workers(tokens))
                    tasks.create_task(self._take_events())
                    tasks.create_task(self._take_answers())
                    tasks.create_task(self._keep_snapshots())
                    tasks.create_task(self._reconciliation.run())
                    tasks.create_task(self._past.delete_keys_in_time())
            except* (Superseded, sqlite3.Error, OSError) as group:
                raise group.exceptions[0] from None
            finally:
                try:
                    self._sync()
                    self._core.keep_last_snapshot(self._outbox.unconfirmed)
                except (sqlite3.Error, OSError) as error:
                    if not is_full(error):
                        raise
                    log.warning("no snapshot could be kept, the next start takes longer: %s", error)

    async def _take_charge(self, first_run: bool) -> None:
        if first_run:
            await self._pool.ready()
        epoch = await self._charge.take()
        self._apply(
            events.PlannerStarted(
                epoch=epoch,
                incarnation=self._incarnation,
                policy=self._policy,
                skills=self._skills,
                logic=LOGIC,
                lineage=self._incarnation,
                **self._clock.at(),
            )
        )

    def _epoch_raised(self, epoch: int) -> None:
        self._incoming.put(events.EpochRaised(epoch=epoch, **self._clock.at()))

    async def _catch_up(
        self, watch: Watch, tokens: TokenWatch[Any], concluded: Collection[FactKey]
    ) -> None:
        """Hear of everything stored that matters, and of what went away meanwhile.

        What the planner `concluded` itself, and may not have published, is not overruled by an
        older word.
        """
        for change in in_order([change async for change in until_synced(watch)]):
            if not (change.key is FACT and outdated(self.state, change, concluded)):
                self._incoming.change(change)
        self._audit.write_replayed()
        here: set[tuple[str, str]] = set()
        async for token in until_synced(tokens):
            self._incoming.token(token)
            if token.alive:
                here.add((token.address.robot, token.address.incarnation))
        for robot, runs in self.state.connected.items():
            for run in runs:
                if (robot, run) not in here:
                    self._apply(
                        events.WorkerDisconnected(robot=robot, incarnation=run, **self._clock.at())
                    )
        while (event := self._incoming.waiting()) is not None:
            self._apply(event)

    def _go_live(self, found: Recovered) -> None:
        """From now on effects are carried out; those of the catching up all at once.

        Until here nothing was ordered, since a report that is not read yet could forbid it. What
        an earlier run may not have done is done again, where the state says nothing else by now.
        """
        held = [e for e in self._held or () if isinstance(e, Publish | Retract)]
        self._held, self._incoming.live = None, True
        self._journal.sync()
        self._past.publish_unsettled()
        state = self.state
        facts = (
            Publish(FACT, FactAddress.of(key), own)
            for key in found.concluded
            if (own := state.concluded.get(key)) is not None and own == state.facts.get(key)
        )
        self._carry_out((*found.retracted, *facts, *held, *effects_of(state)))

    async def _listen(self, watch: Watch) -> None:
        async for change in watch:
            self._incoming.change(change)

    async def _watch_workers(self, tokens: TokenWatch[Any]) -> None:
        async for token in tokens:
            self._incoming.token(token)

    async def _take_events(self) -> None:
        """Take events one after the other."""
        while True:
            effects, together = await self._handled(await self._incoming.next()), 1
            while together < TOGETHER and (more := self._incoming.waiting()) is not None:
                effects += await self._handled(more)
                together += 1
            try:
                if any(isinstance(effect, Publish | Retract) for effect in effects):
                    # What others see must not be taken back by a power cut.
                    await self._disk.synced(self._journal.sync)
            finally:  # also at the end: the last snapshot has what is not confirmed
                self._carry_out(effects)

    async def _handled(self, event: Event) -> list[Effect]:
        """As `_apply`, once there is room to keep it; what is to be done about it is not done."""
        news = await self._disk.written(lambda: self._news(event))
        if news is not None:
            before = self.state
            effects = await self._disk.written(lambda: self._core.apply(news))
            if self.state is not before:
                await self._disk.written(lambda: self._audit.heard(news))
            await self._disk.written(lambda: self._past.keep(effects))
            return [*effects, *over_closures(news, before, self.state)]
        return []

    def _apply(self, event: Event) -> None:
        if (news := self._news(event)) is not None:
            before = self.state
            effects = self._core.apply(news)
            if self.state is not before:
                self._audit.heard(news)
            self._past.keep(effects)
            self._carry_out((*effects, *over_closures(news, before, self.state)))

    def _news(self, event: Event) -> Event | None:
        try:
            return self._past.news(event)
        except (FleetError, sqlite3.Error, OSError):
            raise  # what is kept, and not the event
        except Exception as error:
            self._carry_out(self._core.set_aside(event, error))
            return None

    async def _keep_snapshots(self) -> None:
        """Keep a snapshot whenever there is much to replay, or nothing else to do."""
        before = self._core.replayable
        while True:
            await asyncio.sleep(SNAPSHOT_CHECK_S)
            if self._core.snapshot_due(idle=self._core.replayable == before):
                try:
                    await asyncio.to_thread(self._sync)
                    self._sync()  # the little that was added meanwhile
                    await self._core.keep_snapshot(self._outbox.unconfirmed)
                except (sqlite3.Error, OSError) as error:
                    self._disk.found(error)
            before = self._core.replayable

    def _sync(self) -> None:
        self._past.sync()
        self._audit.sync()

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

    async def _answered(self, _: PlannerAddress, asked: QuestionQuery) -> QuestionReply:
        return answering.answer(self.state, asked)

    async def _tasks_known(self, _: PlannerAddress, asked: TasksQuery) -> TasksReply:
        return tasks_known(self.state, asked)

    async def _take_answers(self) -> None:
        while True:
            answer = await self._pool.answers.get()
            self._incoming.put(replace(answer, **self._clock.at()))
