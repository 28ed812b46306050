"""How long what is over keeps its keys, and how they are deleted.

The archive says what has keys, not the planner's state, which has forgotten it. One message deletes
all keys about a plan, or a goal: a wildcard that the store applies to what it has.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from fleet.history.archive import GOAL, PLAN, REQUEST, Archive, Live
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.keyspace import ANSWER_TREE, GOAL_TREE, PLAN_TREE, REPORT_TREE, REQUEST_TREE
from keyexpr_schema.transport.session import Session

LOOK_S = 60.0
"""Time between two looks at what has come of age."""
AT_ONCE = 16
"""Plans, goals or requests whose keys are being deleted at the same time."""
_RETRY_S = 5.0
_DAY_S = 86_400.0
_TREES = {
    PLAN: (PLAN_TREE, REPORT_TREE),
    GOAL: (GOAL_TREE,),
    REQUEST: (REQUEST_TREE, ANSWER_TREE),
}

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Retention:
    """Keys of what ended within so many `days` are kept; of no more than `count` plans, though, as
    many goals that ended without a plan, and as many requests."""

    days: float = 7.0
    count: int = 200


class Retirement:
    """Deletes the keys of what is over, in time or when somebody asks for it.

    `rejected(before_wall_s, keep)` are goals that the planner's state has because they could yet be
    understood, and that nobody has cared about: all but the newest, or since before a Unix time.
    """

    def __init__(
        self,
        session: Session,
        archive: Archive,
        retention: Retention,
        rejected: Callable[[float, int], Sequence[str]],
    ) -> None:
        self._session, self._archive, self._retention = session, archive, retention
        self._rejected = rejected
        self._more = asyncio.Event()
        self._goals: set[str] = set()

    def wake(self) -> None:
        """There is more that is over."""
        self._more.set()

    def deletes(self, goal: str) -> bool:
        """Whether it is we who are deleting the keys of a goal."""
        return goal in self._goals

    async def run(self) -> None:
        """Delete keys when their time has come, for ever."""
        pause_s = 0.0
        while True:
            try:
                async with asyncio.timeout(pause_s):
                    await self._more.wait()
                timed = False
            except TimeoutError:
                timed = True
            self._more.clear()
            before_s = time.time() - self._retention.days * _DAY_S
            pause_s = LOOK_S
            try:
                await self.end_due(before_s)
                if timed:
                    await self._delete_goals(self._rejected(before_s, self._retention.count))
            except SchemaError as error:
                log.warning("keys of what is over stay for now: %s", error)
                pause_s = _RETRY_S

    async def end_due(self, before_s: float) -> None:
        """Delete the keys of what ended before a Unix time [s], and of all but the newest.

        Raises:
            Unconfirmed: some were still there after a while.
        """
        while due := self._due(before_s):
            await self.end(due)

    def _due(self, before_s: float) -> list[Live]:
        count = self._retention.count
        found = (self._archive.due(kind, count, before_s, AT_ONCE) for kind in _TREES)
        return [live for some in found for live in some]

    async def end(self, over: Sequence[Live]) -> None:
        """Delete the keys of what is over, with those of a plan's goals, and note it.

        Raises:
            Unconfirmed: some were still there after a while; nothing is noted.
        """
        goals = [live.name for live in over if live.kind == GOAL]
        goals += [goal for live in over for goal in live.goals if live.kind == PLAN]
        await self._delete_goals(goals)
        for live in over:
            if live.kind != GOAL:
                await self._delete(live.kind, live.name)
        self._archive.retire(over)

    async def end_goal(self, goal: str) -> None:
        """Delete the keys of one goal, and note it.

        Raises:
            Unconfirmed: they were still there after a while.
        """
        await self._delete_goals([goal])
        self._archive.retire_goal(goal)

    async def _delete_goals(self, goals: Iterable[str]) -> None:
        for goal in goals:
            self._goals.add(goal)
            try:
                await self._delete(GOAL, goal)
            finally:
                self._goals.discard(goal)

    async def _delete(self, kind: str, name: str) -> None:
        await asyncio.gather(*(self._session.delete_tree(tree, name) for tree in _TREES[kind]))
