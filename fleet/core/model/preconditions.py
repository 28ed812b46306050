"""Tasks as ground actions, and whether those can be applied now."""

from __future__ import annotations

from collections.abc import Mapping

from fleet.core.model.derived import holds
from fleet.core.model.skills import Action, Skills
from fleet.core.model.world import WorldModel, known_value, room_left
from keyexpr_schema.facts import FactKey, Literal, Value, render_value
from keyexpr_schema.payloads.tasks import TaskRecord


def action_of(record: TaskRecord, skills: Skills) -> Action | None:
    """The task as a ground action; `None` if the planner was started without that skill."""
    skill = skills.get(record.skill)
    if skill is None or set(skill.parameters) != set(record.args):
        return None
    return skill.ground(record.args)


def first_unmet(
    action: Action, facts: Mapping[FactKey, Value], world: WorldModel
) -> Literal | None:
    """The first precondition of the action that does not hold in `facts`; baskets aside."""

    def value_of(variable: FactKey) -> Value:
        return known_value(variable, facts, world)

    for literal in action.before:
        if not holds(literal, value_of, world):
            return literal
    return None


def applicable(action: Action, facts: Mapping[FactKey, Value], world: WorldModel) -> bool:
    """Whether the action's preconditions hold in `facts`, room in baskets included."""
    return first_unmet(action, facts, world) is None and all(
        room_left(carrier, facts, world) > 0 for carrier in action.space_in
    )


def effects_hold(action: Action, world: WorldModel) -> bool:
    """Whether all that the action makes true is believed already."""
    return all(holds(literal, world.facts.get, world) for literal in action.after)


def unmet_before(action: Action, world: WorldModel) -> str | None:
    """The first precondition that the facts do not grant, as a phrase, or `None`."""
    literal = first_unmet(action, world.facts, world)
    if literal is not None:
        has, wanted = world.value(*literal.variable), literal.value
        return f"{literal.variable} should be {render_value(wanted)} and is {render_value(has)}"
    for carrier in action.space_in:
        if room_left(carrier, world.facts, world) < 1:
            where = f"in {carrier}'s basket" if carrier in world.robots else f"on or in {carrier}"
            return f"there is no room {where}"
    return None
