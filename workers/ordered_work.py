"""What one try of an order is: the call of a skill, or the run of a program."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable

from keyexpr_schema.payloads.tasks import Order, Report, ReportState
from workers.errors import BadArguments
from workers.orders.journal import FinishedCall
from workers.orders.outbox import make_report
from workers.programs.run import ProgramRun
from workers.recovery import make_safe
from workers.retry import run_attempt
from workers.skill_context import SkillContext
from workers.skill_registry import Skill, SkillRegistry


def work_of(
    order: Order,
    ctx: SkillContext,
    registry: SkillRegistry,
    offered: Callable[[], tuple[str, ...]],
    incarnation: str,
    note: Callable[[FinishedCall], Awaitable[None]],
    finished: tuple[FinishedCall, ...] = (),
) -> Callable[[], Awaitable[None]]:
    """What one try of an order is. `offered` are the skills of the robot as it is registered now;
    `note` and `finished` are those of `ProgramRun`.

    Raises:
        UnknownSkill, BadArguments: there is nothing to try.
    """
    if order.program is None:
        skill = registry.get(order.skill, offered())
        arguments = skill.bind(order.args, ctx.robot, ctx.world)
        return lambda: skill(ctx, **arguments)
    if not order.program.code:
        raise BadArguments(f"{order.task}: the order brings no program for its sentence")

    async def run_skill(called: Skill, given: dict[str, str | float]) -> Report:
        return await run_attempt(
            make_report(order, incarnation, ReportState.STARTED),
            called.name,
            lambda: called(ctx, **given),
            now_s=ctx.embodiment.now_s,
            make_safe=lambda: make_safe(ctx.embodiment),
            deadline_s=math.inf,  # that of the order is over all of it
            cancelled=asyncio.Event(),
            on_failure=ctx.observe_failure,
        )

    return ProgramRun(order.program.code, ctx, registry, offered, run_skill, note, finished)
