"""`pick(robot, object, place)`: take an object that lies in a place."""

from __future__ import annotations

from contextlib import aclosing

from keyexpr_schema.facts import AT, HOLDING, NOTHING
from keyexpr_schema.payloads.motions import Detection, MotionKind
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, skill
from workers.skills.looking_around import look_at, looks
from workers.skills.viewpoints import Viewing

LEAST_LOOKS = 2
"""A thing is not to be seen only after looks from two spots: furniture hides things."""


@skill("pick", parameters={"object": ParameterKind.OBJECT, "place": ParameterKind.PLACE})
async def pick(ctx: SkillContext, object: str, place: str) -> None:
    """Take an object into the hand."""
    if not await ctx.has_hand_for(object):
        return
    await ctx.be_in(place)
    seen = await _find(ctx, object, place)
    await ctx.do(MotionKind.APPROACH, object=object, point_m=seen.point_m)
    # From close by the point is known better than from across the room.
    near = next((d for d in await ctx.look() if d.object == object), seen)
    await ctx.do(MotionKind.GRASP, object=object, point_m=near.point_m)
    await ctx.do(MotionKind.STOW)
    ctx.observe_taken(object, await ctx.holding(), f"in {place}")


async def _find(ctx: SkillContext, object: str, place: str) -> Detection:
    viewing = Viewing.of(ctx.world.places[place], ctx.spec)
    async with aclosing(looks(ctx, viewing)) as every:
        async for seen in every:
            if object not in seen and viewing.looks == 1:
                # What is in something is seen from before it.
                inside = [seen[c] for c in ctx.world.carriers(object) if c in seen]
                for container in inside[:1]:
                    seen |= await look_at(ctx, container)
            if (found := seen.get(object)) is not None:
                where = ctx.world.whereabouts(found)
                at = ctx.world.place_of(where)
                if at is None or ctx.world.within(at, place):
                    return found
                raise SkillFailed(
                    f"{object} is at {where}, not in {place}",
                    retryable=False,
                    facts=((AT, object, where),),
                )
            if viewing.complete and viewing.looks >= LEAST_LOOKS:
                break
    closed = ctx.closed_around(object)
    if closed is not None:
        raise SkillFailed(f"{object} is in {closed}, which is closed", retryable=False)
    ctx.observe_missing(object, place)
    raise SkillFailed(
        f"{object} is not to be seen in {place}",
        retryable=False,
        facts=((HOLDING, ctx.robot, NOTHING),),
    )
