"""Which skills bring something about, by what their effects say."""

from __future__ import annotations

from collections.abc import Container

from fleet.core.model.parameter_types import ROBOT
from fleet.core.model.skills import SkillModel
from keyexpr_schema.facts import AT, HELD, HOLDING, IN, LOCATED, ON, SEARCHED
from keyexpr_schema.payloads.goals import Condition

_EFFECTS = {
    AT: {AT, ON, IN},
    ON: {AT, ON},
    IN: {AT, IN},
    HELD: {HOLDING},
    LOCATED: {SEARCHED},
}
"""By what is wanted, the relations one of which a skill must change for it."""


def brings_about(skill: SkillModel, wanted: Condition, robots: Container[str]) -> bool:
    """Whether an effect of the skill can be what is wanted, where its parameters fit."""
    relations = _EFFECTS.get(wanted.relation, {wanted.relation})
    of_robot = wanted.subject in robots or wanted.relation == HELD
    for variable, value in skill.after:
        about_robot = skill.parameters.get(variable.subject) == ROBOT
        any_value = value in skill.parameters or wanted.relation in _EFFECTS
        fits = variable.relation in relations and about_robot is of_robot
        if fits and (any_value or value == wanted.value):
            return True
    return False
