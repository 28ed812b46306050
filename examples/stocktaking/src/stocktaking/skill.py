"""The skill `audit`: how a robot carries it out."""

from __future__ import annotations

from workers import ParameterKind, SkillContext, skill


@skill("audit", parameters={"place": ParameterKind.PLACE})
async def audit(ctx: SkillContext, place: str) -> None:
    """Count what lies in a place."""
    await ctx.be_in(place)
    seen = await ctx.look()
    here = {d.object for d in seen if ctx.world.whereabouts(d) == place}
    ctx.log(f"counts {len(here)} in {place}")
    ctx.observe("stock", place, len(here))
    ctx.observe("audited", place, True)
