"""`look_into(robot, container, place)`: see what is in a thing."""

from __future__ import annotations

from keyexpr_schema.facts import AT, IS_OPEN, SEARCHED
from keyexpr_schema.payloads.motions import MotionKind
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, skill

LEVEL_M = 0.5
"""A point of furniture at this height is what one drives up to so as to look into it."""


@skill("look_into", parameters={"container": ParameterKind.OBJECT, "place": ParameterKind.PLACE})
async def look_into(ctx: SkillContext, container: str, place: str) -> None:
    """Look into a thing and observe what is in it; what was believed there and is not, is unknown.

    What opens must be open.
    """
    await ctx.be_in(place)
    seen = {d.object: d for d in await ctx.look()}
    found = seen.get(container)
    if ctx.known(IS_OPEN, container) is False:
        raise SkillFailed(f"{container} is closed", retryable=False)
    if found is not None:
        x_m, y_m, z_m = found.point_m
        try:
            await ctx.do(MotionKind.APPROACH, point_m=(x_m, y_m, max(z_m, LEVEL_M)))
        except SkillFailed as failure:
            ctx.log(f"looks into {container} from afar: {failure.reason}")
        else:
            seen |= {d.object: d for d in await ctx.look()}
    for missing in ctx.world.objects_at(container):
        if missing not in seen:
            ctx.observe(AT, missing, None)
    ctx.observe(SEARCHED, container, True)
