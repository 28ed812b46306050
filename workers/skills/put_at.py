"""`place_on` and `place_in`: put the held object down on or into a thing."""

from __future__ import annotations

from keyexpr_schema.facts import AT, IS_OPEN, NOTHING
from keyexpr_schema.payloads.motions import MotionKind
from keyexpr_schema.payloads.world import Feature
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, skill


@skill(
    "place_on",
    parameters={
        "object": ParameterKind.OBJECT,
        "onto": ParameterKind.OBJECT,
        "place": ParameterKind.PLACE,
    },
)
async def place_on(ctx: SkillContext, object: str, onto: str, place: str) -> None:
    """Put the held object down on a thing."""
    await _put(ctx, object, onto, place)


@skill(
    "place_in",
    parameters={
        "object": ParameterKind.OBJECT,
        "into": ParameterKind.OBJECT,
        "place": ParameterKind.PLACE,
    },
)
async def place_in(ctx: SkillContext, object: str, into: str, place: str) -> None:
    """Put the held object into a thing; what opens must be open."""
    await _put(ctx, object, into, place)


async def _put(ctx: SkillContext, object: str, target: str, place: str) -> None:
    held = await ctx.holding()
    if held != object:
        await ctx.look()
        if held is None and ctx.known(AT, object) == target:
            return  # an earlier try let it go there
        raise SkillFailed(
            f"{ctx.robot} holds {held or NOTHING}, not {object}, so it cannot put it at {target}",
            retryable=False,
        )
    await ctx.be_in(place)
    try:
        await ctx.do(MotionKind.PLACE_AT, object=target)
    except SkillFailed as failure:
        await ctx.look()
        if ctx.known(IS_OPEN, target) is False:
            raise SkillFailed(f"{target} is closed", retryable=False) from failure
        raise
    still = await ctx.holding()
    seen = {d.object: d for d in await ctx.look()}.get(object)
    await ctx.do(MotionKind.STOW)
    if still == object:
        raise SkillFailed(f"the hand was opened at {target} but still holds {object}")
    if seen is not None and (where := ctx.world.whereabouts(seen)) not in (target, None):
        ctx.observe(AT, object, where)
        raise SkillFailed(f"{object} was put at {target} but is at {where}", retryable=False)
    if seen is None and not ctx.world.objects[target].is_a(Feature.CONTAINS):
        ctx.observe(AT, object, None)
        raise SkillFailed(f"{object} was put on {target} but is not to be seen there now")
    # What is in something may be out of sight.
    ctx.observe(AT, object, target)
