"""Tasks as the calls they are: their ground actions, and whether those can start now."""

from __future__ import annotations

from collections.abc import Mapping

from fleet.core.model.skills import Action, SkillModel
from fleet.core.model.world import WorldModel, first_unmet, room_left
from keyexpr_schema.payloads.tasks import TaskRecord

Skills = Mapping[str, SkillModel]


def action_of(record: TaskRecord, skills: Skills) -> Action | None:
    """The task as a ground action; `None` if the planner was started without that skill."""
    skill = skills.get(record.skill)
    if skill is None or set(skill.parameters) != set(record.args):
        return None
    return skill.ground(record.args)


def unmet_before(action: Action, world: WorldModel) -> str | None:
    """The first precondition that the facts do not grant, as a phrase, or `None`."""
    literal = first_unmet(action, world.facts, world)
    if literal is not None:
        has = world.value(*literal.variable)
        told = "unknown" if has is None else f"{has}"
        return f"{literal.variable} should be {literal.value} and is {told}"
    for carrier in action.space_in:
        if room_left(carrier, world.facts, world) < 1:
            return f"there is no room in {carrier}'s basket"
    return None
