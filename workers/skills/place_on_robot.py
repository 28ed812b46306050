"""`place_on_robot(robot, object, carrier, place)`: put the held object into a carrier's basket."""

from __future__ import annotations

from math import dist

from keyexpr_schema.facts import AT, NOTHING
from keyexpr_schema.payloads.motions import MotionKind, PointM
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, skill

STATE_S = 10.0
"""Wall seconds to wait for a state of the carrier: where it stands, what it carries."""
FIRST_STATE_S = 1.0
"""Wall seconds to wait for it before looking into the basket oneself."""
STOOD_STILL_M = 0.05
MOST_APPROACHES = 3


@skill(
    "place_on_robot",
    parameters={
        "object": ParameterKind.OBJECT,
        "carrier": ParameterKind.ROBOT,
        "place": ParameterKind.PLACE,
    },
)
async def place_on_robot(ctx: SkillContext, object: str, carrier: str, place: str) -> None:
    """Put the held object into the basket of a robot that stands in the same place."""
    held = await ctx.holding()
    if held != object:
        if _in_basket(ctx, object, carrier):  # an earlier try let it down
            ctx.observe(AT, object, carrier)
            return
        raise SkillFailed(
            f"{ctx.robot} holds {held or NOTHING}, not {object}, so it cannot give it to {carrier}",
            retryable=False,
        )
    await ctx.be_in(place)
    await stand_beside(ctx, carrier, place)
    await ctx.do(MotionKind.RELEASE_IN_BASKET, object=object, robot=carrier)
    still = await ctx.holding()
    await ctx.do(MotionKind.STOW)
    if still == object:
        raise SkillFailed(f"the hand was opened over {carrier} but still holds {object}")
    if not await _arrived(ctx, object, carrier):
        raise SkillFailed(f"{object} was let down over {carrier} but is not in its basket")
    ctx.observe(AT, object, carrier)


async def stand_beside(ctx: SkillContext, carrier: str, place: str) -> PointM:
    """Stand where the hand reaches over the carrier; where that stands.

    Raises:
        SkillFailed: it is not there, or does not stand still.
    """
    for _ in range(MOST_APPROACHES):
        point = await _stands_at(ctx, carrier, place)
        await ctx.do(MotionKind.APPROACH, robot=carrier, point_m=point)
        if dist(point, await _stands_at(ctx, carrier, place)) <= STOOD_STILL_M:
            return point
        ctx.log(f"{carrier} has moved: goes after it")
    raise SkillFailed(f"{carrier} does not stand still in {place}")


async def _stands_at(ctx: SkillContext, carrier: str, place: str) -> PointM:
    """Where the carrier stands, by the state that its worker publishes."""

    def there() -> bool:
        state = ctx.world.robots.get(carrier)
        at = None if state is None or state.pose_m_rad is None else state.place
        return ctx.world.within(at, place)

    if not await ctx.world.until(there, STATE_S):
        state = ctx.world.robots.get(carrier)
        if state is None or state.pose_m_rad is None:
            raise SkillFailed(f"{carrier} does not say where it is: is its worker running?")
        where = state.place
        raise SkillFailed(
            f"{carrier} is in {where or 'no place'}, not in {place}",
            facts=() if where is None else ((AT, carrier, where),),
        )
    pose = ctx.robot_pose(carrier)
    assert pose is not None  # `there` held, and nothing has run since
    return pose[0], pose[1], 0.0


async def _arrived(ctx: SkillContext, object: str, carrier: str) -> bool:
    """Whether the object is in the basket: by the carrier's sensor, or by one's own eyes."""
    if await ctx.world.until(lambda: _in_basket(ctx, object, carrier), FIRST_STATE_S):
        return True
    seen = {d.object: d for d in await ctx.look()}.get(object)
    if seen is not None:
        where = ctx.world.whereabouts(seen)
        ctx.observe(AT, object, where)
        return where == carrier
    if await ctx.world.until(lambda: _in_basket(ctx, object, carrier), STATE_S):
        return True
    ctx.observe(AT, object, None)
    return False


def _in_basket(ctx: SkillContext, object: str, carrier: str) -> bool:
    state = ctx.world.robots.get(carrier)
    return state is not None and object in state.basket
