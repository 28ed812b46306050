"""How goals and plans stand, as somebody sees it who watches the planner's keys."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from keyexpr_schema.keyspace import GOAL_STATUS, PLAN_STATUS
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import ENDED_PLANS, PlanState
from keyexpr_schema.transport.session import Session


@dataclass(kw_only=True)
class PlannerNews:
    """Kept up by `follow_planner`. Times are of `time.perf_counter`, s."""

    goals: dict[str, GoalState] = field(default_factory=dict)
    """Goals of which the planner has said something."""
    reasons: dict[str, str | None] = field(default_factory=dict)
    """Why goals stand as they do."""
    plans: dict[str, PlanState] = field(default_factory=dict)
    ended: dict[str, float] = field(default_factory=dict)
    """When plans ended."""
    _news: asyncio.Event = field(default_factory=asyncio.Event)

    async def follow_planner(self, operator: Session) -> None:
        """Watch for ever."""
        async with operator.watch(PLAN_STATUS, GOAL_STATUS) as watch:
            async for change in watch:
                status = change.value
                if status is None:
                    continue
                if change.key is GOAL_STATUS:
                    self.goals[status.goal] = status.state
                    self.reasons[status.goal] = status.reason
                else:
                    self.plans[status.plan] = status.state
                    if status.state in ENDED_PLANS:
                        self.ended.setdefault(status.plan, time.perf_counter())
                self._news.set()

    async def until(self, condition: Callable[[], bool], limit_s: float) -> bool:
        """Wait for news that make a condition hold; whether it did within `limit_s`."""
        return await until_news(self._news, condition, limit_s)


async def until_news(news: asyncio.Event, condition: Callable[[], bool], limit_s: float) -> bool:
    """Look again at each of the `news`, up to `limit_s`; whether the condition holds."""
    until_s = time.perf_counter() + limit_s
    while not condition():
        news.clear()
        try:
            async with asyncio.timeout(until_s - time.perf_counter()):
                await news.wait()
        except TimeoutError:
            return condition()
    return True
