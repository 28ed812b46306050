"""`place(robot, object, place)`: put the held object down in a place."""

from __future__ import annotations

from math import dist

from keyexpr_schema.facts import AT, NOTHING
from keyexpr_schema.payloads.motions import Detection, MotionKind, PointM
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, skill
from workers.skills.put_down_spots import away_from, candidates

MOST_SPOTS = 4
OTHER_SPOT_M = 0.3
"""After a spot that could not be reached, one at least so far away is tried."""
NEAR_M = 0.25
"""A released object that lies within this of the spot is where it was put."""


@skill("place", parameters={"object": ParameterKind.OBJECT, "place": ParameterKind.PLACE})
async def place(ctx: SkillContext, object: str, place: str) -> None:
    """Put the held object down in a place, on furniture if there is any."""
    held = await ctx.holding()
    if held != object:
        await _lies_there_already(ctx, object, place, held)
        return
    await ctx.be_in(place)
    spot = await _approach_free_spot(ctx, object, place)
    await ctx.do(MotionKind.RELEASE, object=object, point_m=spot)
    still = await ctx.holding()
    seen = {d.object: d for d in await ctx.look()}.get(object)
    await ctx.do(MotionKind.STOW)
    if still == object:
        raise SkillFailed(f"the hand was opened in {place} but still holds {object}")
    ctx.observe(AT, object, None if seen is None else ctx.world.whereabouts(seen))
    if seen is None:
        raise SkillFailed(f"{object} was put down in {place} but is not to be seen there now")
    where = ctx.world.whereabouts(seen)
    if not ctx.world.within(ctx.world.place_of(where), place):
        raise SkillFailed(
            f"{object} was put down in {place} but lies in {where or 'no place'}", retryable=False
        )
    off_m = dist(seen.point_m, spot)
    if off_m > NEAR_M:
        ctx.log(f"{object} lies {off_m:.2f} m from where it was put, still in {place}")
    ctx.observe(AT, object, where)


async def _lies_there_already(ctx: SkillContext, object: str, place: str, held: str | None) -> None:
    """Done if an earlier try put the object down; a failure for good if it is not in the hand."""
    for seen in await ctx.look():
        if seen.object != object:
            continue
        where = ctx.world.whereabouts(seen)
        if ctx.world.within(ctx.world.place_of(where), place):
            ctx.observe(AT, object, where)
            return
    raise SkillFailed(
        f"{ctx.robot} holds {held or NOTHING}, not {object}, so it cannot put it down in {place}",
        retryable=False,
    )


async def _approach_free_spot(ctx: SkillContext, object: str, place: str) -> PointM:
    """Stand where the hand reaches a free spot; the spot."""
    seen: tuple[Detection, ...] = await ctx.look()
    taken = [d.point_m[:2] for d in seen if d.object != object]
    robots = [
        state.pose_m_rad[:2]
        for name, state in ctx.world.robots.items()
        if name != ctx.robot and state.pose_m_rad is not None
    ]
    x_m, y_m, _ = (await ctx.embodiment.senses()).pose_m_rad
    spots = candidates(ctx.world.places[place], taken, robots, (x_m, y_m))
    tried: list[PointM] = []
    why = "everything is taken"
    while spots and len(tried) < MOST_SPOTS:
        spot = spots[0]
        try:
            await ctx.do(MotionKind.APPROACH, point_m=spot)
        except SkillFailed as failure:
            why = failure.reason
            tried.append(spot)
            spots = away_from(spots, tried, OTHER_SPOT_M)
        else:
            return spot
    raise SkillFailed(f"no free spot in {place} to put {object} down: {why}")
