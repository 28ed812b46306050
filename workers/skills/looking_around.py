"""Looking for things in a place, from as many spots as it takes."""

from __future__ import annotations

from collections.abc import AsyncGenerator

from keyexpr_schema.payloads.motions import Detection, MotionKind
from keyexpr_schema.payloads.robots import PoseMRad
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skills.viewpoints import Viewing

MOST_LOOKS = 4
NO_WAY_MOST = 3
"""Spots that are tried in vain before the search ends with what was seen."""


async def looks(ctx: SkillContext, viewing: Viewing) -> AsyncGenerator[dict[str, Detection], None]:
    """Look from here, then from one other spot after the other; yields what each look showed.

    Ends when no spot is left to get to or `MOST_LOOKS` is reached; the caller stops earlier.

    Raises:
        SkillFailed: the camera gave nothing.
    """
    pose: PoseMRad = (await ctx.embodiment.senses()).pose_m_rad
    in_vain = 0
    while viewing.looks < MOST_LOOKS:
        seen = await ctx.look()
        viewing.looked_from(pose[0], pose[1])
        yield {detection.object: detection for detection in seen}
        while (spot := viewing.next()) is not None:
            try:
                outcome = await ctx.do(MotionKind.APPROACH, point_m=(*spot, 0.0))
            except SkillFailed as failure:
                ctx.log(f"cannot look from ({spot[0]:.1f}, {spot[1]:.1f}): {failure.reason}")
                in_vain += 1
                viewing.unreachable(spot)
                if in_vain >= NO_WAY_MOST:
                    return
            else:
                # It has been there now; a spot once used is as good as gone.
                viewing.unreachable(spot)
                pose = outcome.senses.pose_m_rad
                break
        else:
            return


async def look_at(ctx: SkillContext, thing: Detection) -> dict[str, Detection]:
    """Come up to a thing and look; what was seen from there, or nothing if one cannot get there."""
    try:
        await ctx.do(MotionKind.APPROACH, point_m=thing.point_m)
    except SkillFailed as failure:
        ctx.log(f"does not get up to {thing.object}: {failure.reason}")
        return {}
    return {detection.object: detection for detection in await ctx.look()}
