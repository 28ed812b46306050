"""`search(robot, place)`: look all over a place."""

from __future__ import annotations

from contextlib import aclosing

from keyexpr_schema.facts import AT, SEARCHED
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, skill
from workers.skills.looking_around import looks
from workers.skills.viewpoints import Viewing


@skill("search", parameters={"place": ParameterKind.PLACE})
async def search(ctx: SkillContext, place: str) -> None:
    """Look all over a place and observe what lies in it.

    What was expected to lie here and was not seen becomes *unknown*, but only if every part of
    the place came into the camera's range.
    """
    await ctx.be_in(place)
    viewing = Viewing.of(ctx.world.places[place], ctx.spec)
    expected = set(ctx.world.visible_in(place))
    found: dict[str, str | None] = {}
    async with aclosing(looks(ctx, viewing)) as every:
        async for seen in every:
            found.update(
                (o, ctx.world.whereabouts(d)) for o, d in seen.items() if ctx.world.moves(o)
            )
            if viewing.complete:
                break
    for thing, where in found.items():
        if where is not None and ctx.known(AT, thing) == where:  # nobody has taken it since
            ctx.observe(AT, thing, where)
    if viewing.complete:
        for missing in sorted(expected - set(found)):
            ctx.observe_missing(missing, place)
    await ctx.be_in(place)
    ctx.observe(SEARCHED, place, True)
