"""`pick_from_robot(robot, object, carrier, place)`: take an object out of a carrier's basket."""

from __future__ import annotations

from keyexpr_schema.payloads.motions import MotionKind
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, skill
from workers.skills.place_on_robot import stand_beside


@skill(
    "pick_from_robot",
    parameters={
        "object": ParameterKind.OBJECT,
        "carrier": ParameterKind.ROBOT,
        "place": ParameterKind.PLACE,
    },
)
async def pick_from_robot(ctx: SkillContext, object: str, carrier: str, place: str) -> None:
    """Take an object out of the basket of a robot that stands in the same place."""
    if not await ctx.has_hand_for(object):
        return
    await ctx.be_in(place)
    point = await stand_beside(ctx, carrier, place)
    seen = next((d for d in await ctx.look() if d.object == object), None)
    if seen is not None:
        where = ctx.world.whereabouts(seen)
        if where != carrier:
            raise SkillFailed(
                f"{object} is at {where or 'no known place'}, not in the basket of {carrier}",
                retryable=False,
            )
        point = seen.point_m
    await ctx.do(MotionKind.GRASP, object=object, robot=carrier, point_m=point)
    await ctx.do(MotionKind.STOW)
    ctx.observe_taken(object, await ctx.holding(), f"at {carrier}")
