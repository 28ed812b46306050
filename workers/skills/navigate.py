"""`navigate(robot, to)`: drive to a place."""

from __future__ import annotations

from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.motions import MotionKind
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, skill

DOORWAY_M = 0.6
"""A robot less than this far inside a place's border may stand in a doorway and block it."""


@skill("navigate", parameters={"to": ParameterKind.PLACE})
async def navigate(ctx: SkillContext, to: str) -> None:
    """Drive to a free spot in a place."""
    senses = await ctx.embodiment.senses()
    x_m, y_m, _ = senses.pose_m_rad
    place = ctx.world.places[to]
    inside = ctx.world.within(senses.place, to)
    if inside and inner_distance_m(place.region_m, x_m, y_m) >= DOORWAY_M:
        ctx.observe(AT, ctx.robot, senses.place)
        return
    senses = (await ctx.do(MotionKind.GO_TO, place=to)).senses
    if senses.place is not None:
        ctx.observe(AT, ctx.robot, senses.place)
    if not ctx.world.within(senses.place, to):
        raise SkillFailed(
            f"{ctx.robot} drove off to {to} but stands in {senses.place or 'no place'}"
        )


def inner_distance_m(
    region_m: tuple[tuple[float, float, float, float], ...], x_m: float, y_m: float
) -> float:
    """How far inside a region of rectangles a point lies (m); negative outside all of them."""
    return max((min(x_m - a, c - x_m, y_m - b, d - y_m) for a, b, c, d in region_m), default=-1.0)
