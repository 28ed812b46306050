"""What people ask of the archive, and have deleted: pages, statistics, keys of what is over."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from sqlite3 import Connection
from typing import TypeVar

from fleet.core.state import State
from fleet.history.archive import PLAN, Archive
from fleet.history.queries import page, stats
from fleet.history.retention import Retirement
from keyexpr_schema.keyspace import HISTORY, HISTORY_STATS, RETIREMENT
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.history import (
    HistoryPage,
    HistoryQuery,
    HistoryStats,
    HistoryStatsQuery,
    Retired,
    RetireQuery,
)
from keyexpr_schema.payloads.system import PlannerAddress
from keyexpr_schema.transport.session import Session

Q = TypeVar("Q")
R = TypeVar("R")
RETIRED_AT_ONCE = 50
"""Of what a person wants deleted; robotctl asks again until nothing is left."""
EVERY = 2**62


class HistoryQuestions:
    """Answers from the archive; `settled` waits for the last values of keys that are over."""

    def __init__(
        self,
        session: Session,
        archive: Archive,
        retirement: Retirement,
        state: Callable[[], State],
        settled: Callable[[], Awaitable[None]],
        on_retired: Callable[[RetireQuery, Retired], None],
    ) -> None:
        """`on_retired` hears of what people have had deleted."""
        self._on_retired = on_retired
        self._session, self._archive, self._retirement = session, archive, retirement
        self._state, self._settled = state, settled

    @asynccontextmanager
    async def answered(self) -> AsyncIterator[None]:
        """Answer until the block ends."""
        async with AsyncExitStack() as stack:
            await stack.enter_async_context(self._session.serve(HISTORY, self._page))
            await stack.enter_async_context(self._session.serve(HISTORY_STATS, self._stats))
            await stack.enter_async_context(self._session.serve(RETIREMENT, self._retire))
            yield

    async def _page(self, _: PlannerAddress, query: HistoryQuery) -> HistoryPage:
        return await asyncio.to_thread(self._read, page, query)

    async def _stats(self, _: PlannerAddress, query: HistoryStatsQuery) -> HistoryStats:
        return await asyncio.to_thread(self._read, stats, query)

    def _read(self, read: Callable[[Connection, Q], R], query: Q) -> R:
        with self._archive.reading() as db:
            return read(db, query)

    async def _retire(self, _: PlannerAddress, query: RetireQuery) -> Retired:
        """Delete keys that a person does not want to see any more, some at a time."""
        await self._settled()
        before_s = time.time() - query.older_than_s
        plans = self._archive.due(PLAN, EVERY, before_s, RETIRED_AT_ONCE) if query.plans else []
        await self._retirement.end(plans)
        goals = list[str]()
        if query.goals:
            goals = [*self._archive.live_goals(before_s), *rejected(self._state(), before_s, EVERY)]
        now = goals[:RETIRED_AT_ONCE]
        for goal in now:
            await self._retirement.end_goal(goal)
        gone = Retired(
            plans=len(plans),
            goals=sum(len(live.goals) for live in plans) + len(now),
            left=len(plans) == RETIRED_AT_ONCE or len(goals) > len(now),
        )
        self._on_retired(query, gone)
        return gone


def rejected(state: State, before_wall_s: float, keep: int) -> list[str]:
    """Goals that were rejected before a Unix time [s], and all but the newest `keep`."""
    statuses = [
        status for status in state.goal_states.values() if status.state is GoalState.REJECTED
    ]
    newest_first = sorted(statuses, key=lambda s: s.wall_time_s or 0.0, reverse=True)
    return [
        status.goal
        for number, status in enumerate(newest_first)
        if number >= keep or (status.wall_time_s is not None and status.wall_time_s < before_wall_s)
    ]
