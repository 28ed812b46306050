"""A planner that has lived long is no bigger than a young one: counted, not timed.

Core, event journal, archive and store are the real ones; between them are no processes and no
links, and robots carry out what they are told.
"""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from msgspec.structs import replace

from fleet.core import events
from fleet.core.effects import Archive as ToArchive
from fleet.core.effects import Effect, Publish, Retract
from fleet.core.events import Event
from fleet.history.archive import Archive
from fleet.history.queries import stats
from fleet.history.retention import Retention, Retirement
from fleet.service.event_journal import EventJournal
from fleet.service.journaled_core import JournaledCore
from fleet.service.snapshots import Snapshot, encode_snapshot
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.key import Address, Key, KeyTree, Payload
from keyexpr_schema.keyspace import GOAL_SPEC, PLAN_REQUEST, REPORT
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.history import HistoryOutcome, HistoryStatsQuery
from keyexpr_schema.payloads.requests import RequestAddress
from keyexpr_schema.payloads.tasks import ReportAddress
from keyexpr_schema.transport.store.storage import Write
from tests.support.fleet_model import FleetModel
from tests.support.household import bring, manipulator

FEW, MANY = 200, 2000
"""Missions lived."""
SOME = 60
"""So many are looked at: journals grow until they are cut, and grow again."""
KEPT = 5
"""Plans that keep their keys."""
DIGITS = 64
"""Bytes that numbers and times may get longer by."""


class Size(NamedTuple):
    """What there is of a planner at some moment."""

    snapshot_bytes: int
    keys: int
    journal_rows: int


class LongLife(FleetModel):
    """A model whose events, documents and past are where a planner and a store keep them."""

    def __init__(
        self, core: JournaledCore, journal: EventJournal, archive: Archive, store: SqliteStore
    ) -> None:
        self.core, self.events, self.archive, self.store = core, journal, archive, store
        self.stamp = 0
        self.retirement = Retirement(
            self,  # type: ignore[arg-type]
            archive,
            Retention(days=1e6, count=KEPT),
            lambda before_wall_s, keep: (),
        )
        super().__init__((manipulator(),), cups=1)

    def apply(self, event: Event) -> None:
        """An event into the journaled core; what people and robots put is in the store before."""
        match event:
            case events.GoalPut():
                self.put(GOAL_SPEC, GoalAddress(event.goal.goal), event.goal)
            case events.PlanRequested():
                self.put(PLAN_REQUEST, RequestAddress(event.request.request), event.request)
            case events.ReportReceived():
                self.put(REPORT, ReportAddress.of(event.report), event.report)
            case _:
                pass
        effects = self.core.apply(event)
        self.state = self.core.state
        self.carry_out(effects)

    def carry_out(self, effects: tuple[Effect, ...]) -> None:
        records = [effect.record for effect in effects if isinstance(effect, ToArchive)]
        self.archive.add(records)
        for effect in effects:
            if isinstance(effect, Publish):
                self.put(effect.key, effect.address, effect.payload)
            elif isinstance(effect, Retract):
                self.write(effect.key.build(effect.address), None)
        for record in records:
            self.archive.settle(record)
        self._take(effects)

    def put(self, key: Key[Any, Any], address: Address, payload: Payload) -> None:
        self.write(key.build(address), key.encode(payload))

    def write(self, keyexpr: str, data: bytes | None) -> None:
        self.stamp += 1
        self.store.apply(
            [Write(f"realm/{keyexpr}", self.stamp << 128 | 7, data is None, "", data or b"")]
        )

    async def delete_tree(self, tree: KeyTree, name: str) -> None:
        self.write(tree.build(name), None)

    async def live(self, first: int, last: int) -> list[Size]:
        """Missions of these numbers, a cup brought to and fro; what is left after the last."""
        sizes = []
        for number in range(first, last + 1):
            room = "hallway" if number % 2 else "living_room"
            goal = replace(bring(1, room), goal=f"g{number}")
            self.receive(events.GoalPut, goal=goal)
            self.plan(request=f"r{number}", plan=f"p{number}" if number % 3 else None)
            self.finish()
            await self.retirement.end_due(-1.0)
            if self.core.snapshot_due(idle=True):
                await self.core.keep_snapshot(())
            for kept in (self.journal, self.effects, self.reports, self.past, self.documents):
                kept.clear()  # by the model, to look at
            if number > last - SOME:
                sizes.append(self.size())
        return sizes

    def size(self) -> Size:
        return Size(
            len(encode_snapshot(Snapshot(state=self.state))),
            len(self.store.select("realm/**")),
            len(list(self.events.events())),
        )


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_planner_is_as_small_after_many_missions_as_after_few(tmp_path: Path) -> None:
    with (
        EventJournal(tmp_path) as journal,
        Archive(tmp_path) as archive,
        SqliteStore(tmp_path / "store") as store,
    ):
        core = JournaledCore(journal, lambda event, why: pytest.fail(f"{event}: {why}"))
        model = LongLife(core, journal, archive, store)
        young = asyncio.run(model.live(1, FEW))
        old = asyncio.run(model.live(FEW + 1, MANY))
        assert {size.keys for size in young} == {size.keys for size in old}
        most = max(size.snapshot_bytes for size in young)
        assert max(size.snapshot_bytes for size in old) <= most + DIGITS
        rows = max(size.journal_rows for size in young)
        assert max(size.journal_rows for size in old) <= rows
        with archive.reading() as db:
            found = stats(db, HistoryStatsQuery()).total
        assert found.goals == {HistoryOutcome.REACHED: MANY}
        assert found.plans == {HistoryOutcome.SUCCEEDED: MANY}
