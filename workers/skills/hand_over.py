"""`hand_over(robot, object, person, place)`: give the held object to a person."""

from __future__ import annotations

from keyexpr_schema.facts import AT, NOTHING
from keyexpr_schema.payloads.motions import MotionKind
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, skill


@skill(
    "hand_over",
    parameters={
        "object": ParameterKind.OBJECT,
        "person": ParameterKind.OBJECT,
        "place": ParameterKind.PLACE,
    },
)
async def hand_over(ctx: SkillContext, object: str, person: str, place: str) -> None:
    """Give the held object into a person's hand."""
    held = await ctx.holding()
    if held != object:
        await ctx.look()
        if held is None and ctx.known(AT, object) == person:
            return  # an earlier try gave it
        raise SkillFailed(
            f"{ctx.robot} holds {held or NOTHING}, not {object}, so it cannot give it to {person}",
            retryable=False,
        )
    await ctx.be_in(place)
    await ctx.do(MotionKind.HAND_OVER, object=person)
    if await ctx.holding() == object:
        raise SkillFailed(f"the hand was opened before {person} but still holds {object}")
    ctx.observe(AT, object, person)
    await ctx.do(MotionKind.STOW)
