"""`charge(robot, charger, place)`: fill the battery, and leave the charger to others."""

from __future__ import annotations

from keyexpr_schema.facts import AT, CHARGE
from keyexpr_schema.payloads.motions import MotionKind
from keyexpr_schema.payloads.robots import FULL, charge_step
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, skill

DOCKING_S = 180.0
"""How long the way to a charger, others on it included, may take beside the charging itself."""
MARGIN = 1.2
"""How much longer than it should charging may take."""
NEARLY_FULL = 99.0
"""A battery that is so full [%] is not charged."""


@skill("charge", parameters={"charger": ParameterKind.OBJECT, "place": ParameterKind.PLACE})
async def charge(ctx: SkillContext, charger: str, place: str) -> None:
    """Dock at a charger until the battery is full, and drive off it again."""
    battery, level = ctx.spec.battery, (await ctx.embodiment.senses()).charge
    if battery is None or level is None:
        raise SkillFailed(f"{ctx.robot} has no battery to charge", retryable=False)
    if level < NEARLY_FULL:
        await ctx.be_in(place)
        longest_s = DOCKING_S + MARGIN * battery.charging_s(0.0)
        ended = await ctx.do(MotionKind.CHARGE, object=charger, timeout_s=longest_s)
        level = FULL if ended.senses.charge is None else ended.senses.charge
        senses = (await ctx.do(MotionKind.GO_TO, place=place)).senses
        ctx.observe(AT, ctx.robot, senses.place or place)
    ctx.observe(CHARGE, ctx.robot, charge_step(level))
