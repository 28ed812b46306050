"""`look_into(robot, container, place)`: see what is in a thing."""

from __future__ import annotations

from keyexpr_schema.facts import AT, IS_OPEN, SEARCHED
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, skill
from workers.skills.looking_around import look_at


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
        seen |= await look_at(ctx, found)
    for missing in ctx.world.objects_at(container):
        if missing not in seen:
            ctx.observe(AT, missing, None)
    ctx.observe(SEARCHED, container, True)
