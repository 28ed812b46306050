"""Robots that take orders: the real skills and the real retry machine, without keys or journals."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from msgspec.structs import replace

from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.tasks import Order, Report, ReportState
from keyexpr_schema.payloads.world import Fact
from workers.embodiment import Embodiment
from workers.errors import BadArguments, UnknownSkill
from workers.orders.outbox import make_report
from workers.recovery import make_safe, observe_robot
from workers.retry import run_attempt
from workers.skill_context import SkillContext
from workers.skill_registry import SkillRegistry
from workers.world_cache import WorldCache

INCARNATION = "benchmark"
Publish = Callable[[tuple[Fact, ...], Report | None], None]
"""Takes facts, and the report that they belong to."""


class RobotWorker:
    """Carries out one order after the other; what `workers.runtime.Worker` does over Zenoh."""

    def __init__(
        self,
        spec: RobotSpec,
        embodiment: Embodiment,
        world: WorldCache,
        registry: SkillRegistry,
        publish: Publish,
    ) -> None:
        self.spec = spec
        self._embodiment = embodiment
        self._world = world
        self._registry = registry
        self._publish = publish
        self._queue: asyncio.Queue[tuple[str, str, int]] = asyncio.Queue()
        self._orders_by_attempt: dict[tuple[str, str, int], Order] = {}
        self._current: tuple[str, str, int] | None = None
        self._cancelled = asyncio.Event()

    async def introduce_itself(self) -> None:
        """Say where the robot is and what it holds."""
        ctx = SkillContext(self.spec, self._embodiment, self._world)
        await observe_robot(ctx)
        self._publish(ctx.observed, None)

    def order(self, order: Order) -> None:
        """Take an order, or the cancellation of one."""
        name = (order.plan, order.task, order.attempt)
        if order.cancelled and name == self._current:
            self._cancelled.set()
            return
        if name not in self._orders_by_attempt:
            self._queue.put_nowait(name)
        self._orders_by_attempt[name] = order

    def withdraw(self, plan: str, task: str) -> None:
        """An order is no longer there: do not begin it."""
        for name in [name for name in self._orders_by_attempt if name[:2] == (plan, task)]:
            if name != self._current:
                self._orders_by_attempt[name] = _cancelled(self._orders_by_attempt[name])

    async def work(self) -> None:
        """Carry out orders for ever."""
        while True:
            name = await self._queue.get()
            order = self._orders_by_attempt[name]
            if order.cancelled:
                self._publish((), make_report(order, INCARNATION, ReportState.CANCELLED))
                continue
            self._current = name
            self._cancelled.clear()
            await self._carry_out(order)
            self._current = None

    async def _carry_out(self, order: Order) -> None:
        try:
            skill = self._registry.get(order.skill, self.spec.skills)
            arguments = skill.bind(order.args, self.spec.robot, self._world)
        except (UnknownSkill, BadArguments) as error:
            refusal = make_report(
                order, INCARNATION, ReportState.REFUSED, str(error), retryable=False
            )
            self._publish((), refusal)
            return
        ctx = SkillContext(self.spec, self._embodiment, self._world)
        started_s = self._embodiment.now_s()
        started = make_report(order, INCARNATION, ReportState.STARTED, started_s=started_s)
        self._publish((), started)
        ended = await run_attempt(
            started,
            order.skill,
            lambda: skill(ctx, **arguments),
            now_s=self._embodiment.now_s,
            make_safe=lambda: make_safe(self._embodiment),
            deadline_s=order.deadline_s,
            cancelled=self._cancelled,
            on_failure=ctx.observe_failure,
        )
        self._publish(ctx.observed, replace(ended, facts=ctx.observed))


def _cancelled(order: Order) -> Order:
    return replace(order, cancelled=True)
