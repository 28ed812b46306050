"""`open`, `close`, `switch_on` and `switch_off`: change the state of a thing by hand."""

from __future__ import annotations

from keyexpr_schema.facts import IS_ON, IS_OPEN
from keyexpr_schema.payloads.motions import MotionKind
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, skill

PARAMETERS = {"thing": ParameterKind.OBJECT, "place": ParameterKind.PLACE}


@skill("open", parameters=PARAMETERS)
async def open_thing(ctx: SkillContext, thing: str, place: str) -> None:
    """Open a door or a drawer."""
    await _change(ctx, MotionKind.OPEN, thing, place)
    ctx.observe(IS_OPEN, thing, True)


@skill("close", parameters=PARAMETERS)
async def close_thing(ctx: SkillContext, thing: str, place: str) -> None:
    """Close a door or a drawer."""
    await _change(ctx, MotionKind.CLOSE, thing, place)
    ctx.observe(IS_OPEN, thing, False)


@skill("switch_on", parameters=PARAMETERS)
async def switch_on(ctx: SkillContext, thing: str, place: str) -> None:
    """Switch a thing on."""
    await _change(ctx, MotionKind.SWITCH_ON, thing, place)
    ctx.observe(IS_ON, thing, True)


@skill("switch_off", parameters=PARAMETERS)
async def switch_off(ctx: SkillContext, thing: str, place: str) -> None:
    """Switch a thing off."""
    await _change(ctx, MotionKind.SWITCH_OFF, thing, place)
    ctx.observe(IS_ON, thing, False)


async def _change(ctx: SkillContext, kind: MotionKind, thing: str, place: str) -> None:
    """Do it with an empty hand, from the place where the thing is."""
    held = await ctx.holding()
    if held is not None:
        raise SkillFailed(f"{ctx.robot} has no hand free: it holds {held}", retryable=False)
    await ctx.be_in(place)
    await ctx.do(kind, object=thing)
