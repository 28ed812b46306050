"""Missions one after the other through core and store, as many as a fleet has in years.

Core, event journal, archive, retention and store are the real ones, on files; between them are no
processes and no links, and the clock of all of them is simulated, so that days of retention pass.
What people and robots say is in the store before the core hears it, and what the core wants is in
the archive and in the store before anything else happens.
"""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from benchmarks.scale.core_run import CoreRun
from benchmarks.scale.errands import SOURCE, Errands
from benchmarks.scale.processes import folder_mb, rss_mb
from fleet.core import events
from fleet.core.effects import Archive as ToArchive
from fleet.core.effects import Effect, MakePlan, Publish, Retract, documents_of, effects_of
from fleet.core.events import Event
from fleet.history.archive import FILE, Archive
from fleet.history.retention import Retention, Retirement
from fleet.service.event_journal import EventJournal
from fleet.service.journaled_core import JournaledCore
from fleet.service.skill_models import load_all_skills
from fleet.service.snapshots import Snapshot, encode_snapshot
from fleet.stores import SqliteStore, StoreMemory
from keyexpr_schema.key import KeyTree
from keyexpr_schema.keyspace import FACT, GOAL_SPEC, OBJECT, PLAN_REQUEST, REPORT
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.history import Ended
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import RequestAddress
from keyexpr_schema.payloads.tasks import ReportAddress
from keyexpr_schema.payloads.world import FactAddress, ObjectAddress
from keyexpr_schema.transport.store.storage import Write

REALM = "realm"
STORE, EVENTS, ARCHIVE = "store/state.sqlite", "planner/events.db", f"planner/{FILE}"
ROBOTS, CUPS = 4, 12
MISSION_S = 600.0
"""Simulated time from one mission to the next."""
_DAY_S = 86_400.0
_BEGAN_S = 1.6e9
"""The simulated clock is that of a year that has passed: its numbers are as long as today's."""


@dataclass(frozen=True)
class Size:
    """What there is of planner and store at some moment."""

    state_bytes: int
    keys: int
    deletions: int
    store_journal: int
    planner_journal: int
    store_mb: float
    planner_mb: float
    history_mb: float
    rss_mb: float


class LongLife(CoreRun):
    """A fleet whose planner and store keep in `folder` what they keep; use in a `with` block.

    It goes on there with the mission after the last, however it ended.
    """

    def __init__(
        self, folder: Path, retention: Retention | None = None, memory: StoreMemory | None = None
    ) -> None:
        self._folder, self._memory = folder, memory
        self._retention = retention or Retention()
        self._stamp = 0
        self.time_s = _BEGAN_S  # the store asks for it while it is opened
        self.set_aside: list[str] = []
        """Why events could not be handled, where any could not."""
        self._open = ExitStack()
        self.missions = 0

    def __enter__(self) -> Self:
        self._begin()
        super().__init__(ROBOTS, began_s=_BEGAN_S)
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def _begin(self) -> None:
        enter = self._open.enter_context
        self._journal = enter(EventJournal(self._folder / "planner"))
        self.archive = enter(Archive(self._folder / "planner"))
        self._store = enter(
            SqliteStore(
                self._folder / "store", memory=self._memory, wall_time_s=lambda: self.time_s
            )
        )
        self._core = JournaledCore(
            self._journal, lambda event, why: self.set_aside.append(f"{event}: {why}")
        )
        self._retirement = Retirement(
            self,  # type: ignore[arg-type]  # nobody else is asked to delete keys
            self.archive,
            self._retention,
            lambda before_wall_s, keep: (),
        )
        self._core.recover(load_all_skills(), lambda effects: self.archive.add(_records(effects)))

    def start_again(self) -> float:
        """Planner and store end and start again; the seconds of CPU of that start."""
        self._open.close()
        self._open = ExitStack()
        began_s = time.process_time()
        self._begin()
        took_s = time.process_time() - began_s
        self.begin_run(self._core.state.epoch + 1)
        return took_s

    def begin_run(self, epoch: int) -> None:
        """The planner starts; what was under way when an earlier run ended comes to its end."""
        before = self.state = self._core.state
        if before.epoch:
            self.time_s = before.time_s
            newest = _one(self._folder / STORE, "SELECT max(stamp) FROM latest")
            self._stamp = int.from_bytes(newest, "big") >> 128
        super().begin_run(before.epoch + 1)
        for record in self.archive.unsettled():
            self._write(wanted_by(tuple(documents_of(record))))
            self.archive.settle(record)
        for effect in effects_of(self.state) if before.epoch else ():
            if isinstance(effect, MakePlan):
                job = effect.given.job
                self.apply(_errand(int(job.plan.removeprefix("m"))).made(job.job, self.at()))
            elif isinstance(effect, Publish):
                self.heard(effect)
        self.work()
        self.plans.clear()
        lived = "SELECT count(*) FROM ended WHERE kind = 'plan'"
        self.missions = _one(self._folder / ARCHIVE, lived)

    # --- what happens ----------------------------------------------------------------------------

    def handle(self, event: Event) -> tuple[Effect, ...]:
        """An event into the journaled core, between what was said and what follows from it."""
        self._write(said_by(event))
        effects = self._core.apply(event)
        self.state = self._core.state
        records = _records(effects)
        if records:
            self.archive.add(records)
        self._write(wanted_by(effects))
        for record in records:
            self.archive.settle(record)
        return effects

    def _write(self, documents: Iterator[tuple[str, bytes | None]]) -> None:
        batch = []
        for keyexpr, data in documents:
            self._stamp += 1
            stamp = self._stamp << 128 | 7
            batch.append(Write(f"{REALM}/{keyexpr}", stamp, data is None, "", data or b""))
        if batch:
            self._store.apply(batch)

    async def delete_tree(self, tree: KeyTree, name: str) -> None:
        """What `Retirement` asks of its session."""
        self._write(iter([(tree.build(name), None)]))

    async def mission(self) -> None:
        """A cup is brought to the next room; whatever is old enough goes."""
        number, self.missions = self.missions, self.missions + 1
        self.wait(MISSION_S)
        wanted = _errand(number)
        self.put_cups([number % CUPS])  # somebody has put it back
        self.put_goals([number], cups=CUPS)
        self.apply(self.ask(wanted))
        self.work()
        state = self.plans.pop(wanted.plan)
        if state is not PlanState.SUCCEEDED or self.set_aside:
            raise SystemExit(f"{wanted.plan} is {state.value}, set aside {self.set_aside}")
        await self._retirement.end_due(self.time_s - self._retention.days * _DAY_S)
        if self._core.snapshot_due(idle=False):
            await self._core.keep_snapshot(())
        for kept in (self.given, self.seen, self.succeeded):
            kept.clear()  # by us, to look at

    async def live_through(self, missions: int) -> None:
        """So many missions."""
        for _ in range(missions):
            await self.mission()

    def size(self) -> Size:
        """What there is now."""
        store, events_file = self._folder / STORE, self._folder / EVENTS
        history = self._folder / ARCHIVE
        history_mb = sum(f.stat().st_size for f in history.parent.glob(f"{FILE}*")) / 2**20
        return Size(
            state_bytes=len(encode_snapshot(Snapshot(state=self.state))),
            keys=_one(store, "SELECT count(*) FROM latest WHERE NOT deleted"),
            deletions=_one(store, "SELECT count(*) FROM latest WHERE deleted"),
            store_journal=_one(store, "SELECT count(*) FROM journal"),
            planner_journal=_one(events_file, "SELECT count(*) FROM events"),
            store_mb=folder_mb(store.parent),
            planner_mb=folder_mb(history.parent) - history_mb,
            history_mb=history_mb,
            rss_mb=rss_mb(os.getpid()),
        )


def said_by(event: Event) -> Iterator[tuple[str, bytes | None]]:
    """What people and robots have put for the core to hear of an event."""
    match event:
        case events.GoalPut():
            yield GOAL_SPEC.build(GoalAddress(event.goal.goal)), GOAL_SPEC.encode(event.goal)
        case events.PlanRequested():
            address = RequestAddress(event.request.request)
            yield PLAN_REQUEST.build(address), PLAN_REQUEST.encode(event.request)
        case events.ReportReceived():
            yield REPORT.build(ReportAddress.of(event.report)), REPORT.encode(event.report)
        case events.ObjectPut():
            yield OBJECT.build(ObjectAddress(event.object.object)), OBJECT.encode(event.object)
        case events.FactPut() if event.fact.source == SOURCE:
            yield FACT.build(FactAddress.of(event.fact.key)), FACT.encode(event.fact)
        case _:
            pass


def wanted_by(effects: Sequence[Effect]) -> Iterator[tuple[str, bytes | None]]:
    """What the core wants of the keys."""
    for effect in effects:
        if isinstance(effect, Publish):
            yield effect.key.build(effect.address), effect.key.encode(effect.payload)
        elif isinstance(effect, Retract):
            yield effect.key.build(effect.address), None


def _errand(number: int) -> Errands:
    return Errands(f"m{number}", [number], ROBOTS, cups=CUPS)


def _records(effects: Iterable[Effect]) -> list[Ended]:
    return [effect.record for effect in effects if isinstance(effect, ToArchive)]


def _one(database: Path, query: str) -> Any:
    db = sqlite3.connect(database)
    try:
        return db.execute(query).fetchone()[0]
    finally:
        db.close()
