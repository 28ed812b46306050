"""Whether what is said of the world fits what skill files declare of relations."""

from __future__ import annotations

from collections.abc import Iterator

from fleet.core.model.derived import DERIVED
from fleet.core.model.formulas.evaluation import is_number
from fleet.core.model.parameter_types import parse_type
from fleet.core.model.preconditions import spoken_of, written_by
from fleet.core.model.relation_types import BOOL, NUMBER, RelationType
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import AT, HOLDING, IN, ON, SEARCHED, Literal, Value, render_value


def misfit(literal: Literal, world: WorldModel) -> str | None:
    """What is wrong with saying it, as a sentence; `None` where nothing is declared against it."""
    (relation, subject), value = literal
    for skill in world.skills.values():
        declared = skill.relations.get(relation)
        if declared is None:
            continue
        if world.kind_of(subject) and not world.is_of_type(subject, parse_type(declared.of)):
            of = f"{subject} is none" if " " not in declared.of else f"{subject} is not that"
            return f"{literal}: {relation} is said of {declared.of}, and {of}"
        if not _is_value(value, declared, world):
            return f"{literal}: {relation} is {_values(declared)}, not {render_value(value)}"
    return None


def relations_of(world: WorldModel) -> frozenset[str]:
    """Every relation that skills or facts speak of."""
    return frozenset((AT, ON, IN, HOLDING, SEARCHED, *DERIVED, *_spoken_of(world)))


def _spoken_of(world: WorldModel) -> Iterator[str]:
    yield from (key.relation for key in world.facts)
    for skill in world.skills.values():
        action = skill.ground({name: name for name in skill.parameters})
        yield from skill.relations
        yield from (literal.variable.relation for literal in action.before)
        yield from (key.relation for key in written_by(action))
        for formula in (*action.conditions, *(effect.when for effect in action.conditional)):
            yield from (key.relation for key in spoken_of(formula))


def _is_value(value: Value, declared: RelationType, world: WorldModel) -> bool:
    if value is None:
        return True
    if isinstance(declared.values, tuple):
        return value in declared.values
    if declared.values == BOOL:
        return isinstance(value, bool)
    if declared.values == NUMBER:
        return is_number(value)
    return isinstance(value, str) and world.is_of_type(value, parse_type(declared.values))


def _values(declared: RelationType) -> str:
    if isinstance(declared.values, tuple):
        return " or ".join(declared.values)
    return {BOOL: "true or false", NUMBER: "a number"}.get(declared.values, f"a {declared.values}")
