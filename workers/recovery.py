"""What a worker does before it takes orders: find out how it left the world, and report it."""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress

from msgspec.structs import replace

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.facts import AT, CHARGE
from keyexpr_schema.payloads.motions import Motion, MotionKind, Senses
from keyexpr_schema.payloads.robots import charge_step
from keyexpr_schema.payloads.tasks import Order, Report, ReportState
from workers.embodiment import Embodiment
from workers.errors import RobotUnreachable, SkillFailed
from workers.orders.fencing import Ledger, Phase
from workers.skill_context import SkillContext

SAFE_S = 60.0
"""Wall seconds that bringing the body to rest may take before the worker goes on without."""
SENSES_S = 3.0
"""Wall seconds that sensors are waited for when an attempt has failed or was cancelled."""
DRIVER_S = 1.0
"""Wall seconds between two questions to a driver that does not answer yet."""

OBJECT_ARGUMENT = "object"
"""The argument of an order that names the thing it handles, if it handles one."""

_log = logging.getLogger("robotfleet.worker.recovery")


def interrupted(report: Report, reason: str, ctx: SkillContext) -> Report:
    """An attempt that ends now for no fault of its own, with what was observed in it."""
    state = ReportState.INTERRUPTED
    return replace(report, state=state, reason=reason, facts=ctx.observed, ended_s=ctx.now_s)


async def make_safe(embodiment: Embodiment) -> None:
    """Bring the robot to rest with its arm folded, keeping what it holds.

    What goes wrong is logged and nothing more: this runs after a failure, which is what the
    report is about.
    """
    try:
        async with asyncio.timeout(SAFE_S):
            await embodiment.stop()
            outcome = await embodiment.perform(Motion(kind=MotionKind.STOW))
        if outcome.reason is not None:
            _log.info("%s: stow: %s", embodiment.robot, outcome.reason)
    except (RobotUnreachable, SchemaError, TimeoutError) as error:
        _log.warning(
            "%s could not be brought to rest: %s", embodiment.robot, str(error) or "no answer"
        )


async def first_senses(embodiment: Embodiment) -> Senses:
    """The first reading of the sensors, however long the driver takes to come up."""
    warned = False
    while True:
        try:
            return await embodiment.senses()
        except (RobotUnreachable, SchemaError) as error:
            if not warned:
                _log.warning("%s waits for the driver of its robot: %s", embodiment.robot, error)
            warned = True
            await asyncio.sleep(DRIVER_S)


async def observe_robot(ctx: SkillContext, order: Order | None = None) -> Senses:
    """Observe what the robot's own sensors know: where it is, what hand and basket hold, and how
    full its battery is. What `order` is about may be in neither, and have been thought to be.
    What they said."""
    senses = await first_senses(ctx.embodiment)
    if senses.place is not None:
        ctx.observe(AT, ctx.robot, senses.place)
    ctx.observe_carried(senses, *_handled(order))
    if senses.charge is not None:
        ctx.observe(CHARGE, ctx.robot, charge_step(senses.charge))
    for thing in senses.basket:
        ctx.observe(AT, thing, ctx.robot)
    return senses


def _handled(order: Order | None) -> tuple[str, ...]:
    thing = None if order is None else order.args.get(OBJECT_ARGUMENT)
    return () if thing is None else (thing,)


async def observe_what_is_left(ctx: SkillContext, order: Order) -> None:
    """Observe, without moving, what an attempt that did not succeed has left. Silent sensors say
    nothing of it."""
    with suppress(TimeoutError, SchemaError):
        async with asyncio.timeout(SENSES_S):
            await observe_robot(ctx, order)


def was_interrupted(ledger: Ledger) -> bool:
    """Whether the last attempt ended with its worker, which left the arm wherever it was."""
    attempts = list(ledger.attempts.values())
    if any(attempt.phase is Phase.STARTED for attempt in attempts):
        return True
    last = attempts[-1].report if attempts else None
    return last is not None and last.state is ReportState.INTERRUPTED


async def observe_after_crash(ctx: SkillContext, order: Order) -> None:
    """Observe what one can after a crash in the middle of `order`.

    The order's object is where the hand or the eyes say; if neither does, it is unknown.
    """
    await observe_robot(ctx, order)
    seen: dict[str, str | None] = {}
    try:
        seen = {d.object: ctx.world.whereabouts(d) for d in await ctx.look()}
    except (SkillFailed, RobotUnreachable, SchemaError) as error:
        ctx.log(f"could not look around: {error}")
    senses = await observe_robot(ctx, order)  # once more: to look has taken a while
    for name, where in seen.items():
        if where is not None and name != senses.holding:
            ctx.observe(AT, name, where)
    for thing in _handled(order):
        if seen.get(thing) is None and senses.place is not None:
            ctx.observe_not_at(thing, senses.place)
