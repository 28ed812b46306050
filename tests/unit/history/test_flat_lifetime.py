"""A planner that has lived long is no bigger than a young one, and does no more: it is counted.

Core, event journal, archive, retention and store are the real ones; between them are no processes
and no links, and robots report at once (`benchmarks.scale.long_life`).
"""

from __future__ import annotations

import asyncio
import sys
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from benchmarks.scale.long_life import LongLife, Size
from fleet.history.queries import stats
from fleet.history.retention import Retention
from fleet.stores import StoreMemory
from keyexpr_schema.payloads.history import HistoryOutcome, HistoryStatsQuery

YOUNG, OLD = 240, 640
"""Missions lived."""
SOME = 90
"""So many are looked at: journals grow until they are cut, after 84, and grow again."""
DIGITS = 64
"""Bytes that numbers and times may get longer by."""
RETENTION = Retention(days=1e6, count=5)
MEMORY = StoreMemory(journal_mb=1.0, tombstones=300)


@dataclass
class Seen:
    """What there was after each of some missions, and how many functions each called."""

    sizes: list[Size] = field(default_factory=list)
    calls: list[int] = field(default_factory=list)

    def most(self, name: str) -> float:
        return max(getattr(size, name) for size in self.sizes)


async def look_at(life: LongLife, missions: int) -> Seen:
    seen = Seen()
    for _ in range(missions):
        calls = 0

        def count(_: object, what: str, __: object) -> None:
            nonlocal calls
            calls += what in ("call", "c_call")

        sys.setprofile(count)
        try:
            await life.mission()
        finally:
            sys.setprofile(None)
        seen.calls.append(calls)
        seen.sizes.append(life.size())
    return seen


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_planner_and_store_are_as_small_after_many_missions_as_after_few(tmp_path: Path) -> None:
    with LongLife(tmp_path, RETENTION, MEMORY) as life:
        asyncio.run(life.live_through(YOUNG - SOME))
        young = asyncio.run(look_at(life, SOME))
        asyncio.run(life.live_through(OLD - YOUNG - SOME))
        life.start_again()
        old = asyncio.run(look_at(life, SOME))
        assert {size.keys for size in young.sizes} == {size.keys for size in old.sizes}
        assert old.most("state_bytes") <= young.most("state_bytes") + DIGITS
        for name in ("deletions", "store_journal", "planner_journal"):
            assert old.most(name) <= 1.05 * young.most(name), name
        assert old.most("store_mb") <= 1.05 * young.most("store_mb")
        assert sum(old.calls) <= 1.05 * sum(young.calls)
        with life.archive.reading() as db:
            found = stats(db, HistoryStatsQuery()).total
        assert found.goals == {HistoryOutcome.REACHED: OLD}
        assert found.plans == {HistoryOutcome.SUCCEEDED: OLD}
