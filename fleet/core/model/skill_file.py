"""Skill files: YAML read into skill models, with sentences on what is wrong in them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from math import inf
from typing import Any

from fleet.core.model.derived import DERIVED
from fleet.core.model.formulas.nodes import TRUE, ConditionalEffect, Formula, relations_of
from fleet.core.model.formulas.text import KEYWORDS, BadFormula, parse_effect, parse_formula
from fleet.core.model.parameter_types import OBJECT, PLACE, ROBOT, BadType, parse_type
from fleet.core.model.relation_types import (
    RelationType,
    check_literals,
    narrowed_parameters,
    relation_types,
    state_words,
)
from fleet.core.model.skills import MEASURES, SPACE, Need, SkillModel
from fleet.errors import BadSkillFile
from fleet.language.vocabulary import StateWord
from keyexpr_schema.facts import AT, IN, ON, FactKey, Literal, parse_literal, render_value
from keyexpr_schema.yaml_reader import YamlFile, line_in

_SPACE = re.compile(rf"^\s*{SPACE}\(\s*(\w+)\s*\)\s*$")
_NEED = re.compile(r"^\s*(\w+)(?:\s*>=\s*(\w+)\(\s*(\w+)\s*\))?\s*$")
_FIELDS = frozenset(
    {"about", "parameters", "needs", "before", "after", "duration_s", "travel_to", "says"}
)


def skills_from_data(data: Any, where: str | YamlFile) -> dict[str, SkillModel]:
    """Skill models from the parsed YAML of a skill file; `where` names the file in errors.

    Raises:
        BadSkillFile: one sentence that names skill and field, and says what would be right.
    """
    if not isinstance(data, dict) or not isinstance(data.get("skills"), dict):
        raise BadSkillFile(f"{where}: there must be a mapping `skills:` of skill names to models")
    declared = data.get("relations", {})
    of = f"{where}{line_in(where, 'relations')}"
    relations = relation_types(declared, of)
    words = state_words(declared, relations, of)
    return {
        name: _skill(
            name,
            model,
            relations,
            words,
            f"{where}{line_in(where, f'skills.{name}')}: skill {name}",
        )
        for name, model in data["skills"].items()
    }


def _skill(
    name: str,
    model: Any,
    relations: Mapping[str, RelationType],
    words: Sequence[StateWord],
    where: str,
) -> SkillModel:
    if not isinstance(model, dict):
        raise BadSkillFile(f"{where} must be a mapping with {', '.join(sorted(_FIELDS))}")
    if unknown := set(model) - _FIELDS:
        raise BadSkillFile(
            f"{where} has no field {', '.join(sorted(map(str, unknown)))}; "
            f"its fields are {', '.join(sorted(_FIELDS))}"
        )
    parameters = _parameters(model.get("parameters"), where)
    if ROBOT not in parameters.values():
        raise BadSkillFile(f"{where} needs a parameter of type robot: the one that does it")
    duration = model.get("duration_s", 10.0)
    number = isinstance(duration, int | float) and not isinstance(duration, bool)
    if not number or not 0 <= duration < inf:
        raise BadSkillFile(f"{where}: `duration_s` must be a number of seconds, not {duration!r}")
    travel_to = model.get("travel_to")
    named = isinstance(travel_to, str)
    if travel_to is not None and (not named or parameters.get(travel_to) != PLACE):
        raise BadSkillFile(f"{where}: `travel_to` must name a parameter of type place")
    before_text = _list_of_text(model.get("before", []), f"{where}: `before`")
    space_in = tuple(m[1] for text in before_text if (m := _SPACE.match(text)))
    for subject in space_in:
        if PLACE in parse_type(parameters.get(subject, PLACE)).bases:
            raise BadSkillFile(
                f"{where}: {SPACE}({subject}) must name a parameter of type robot, or of a thing"
            )
    before, conditions = _conditions(before_text, parameters, f"{where}: `before`")
    after_text = _list_of_text(model.get("after", []), f"{where}: `after`")
    after, conditional = _effects(after_text, parameters, f"{where}: `after`")
    always = (*before, *after)
    check_literals(always, conditions, conditional, parameters, relations, where)
    spoken_of = {
        *(literal.variable.relation for literal in always),
        *(effect.variable.relation for effect in conditional),
        *(
            name
            for row in (*conditions, *(e.when for e in conditional))
            for name in relations_of(row)
        ),
    }
    return SkillModel(
        name=name,
        about=str(model.get("about", "")),
        parameters=narrowed_parameters(parameters, always, relations, where),
        needs=_needs(model.get("needs", {}), parameters, where),
        before=before,
        after=after,
        space_in=space_in,
        duration_s=float(duration),
        travel_to=travel_to,
        conditions=conditions,
        conditional=conditional,
        relations={name: relations[name] for name in sorted(spoken_of & relations.keys())},
        says=_says(model.get("says", []), parameters, f"{where}: `says`"),
        state_words=tuple(word for word in words if word.relation in spoken_of),
    )


def _parameters(data: Any, where: str) -> dict[str, str]:
    if not isinstance(data, dict) or not all(isinstance(kind, str) for kind in data.values()):
        raise BadSkillFile(
            f"{where}: `parameters` must map names to types: robot, place, object, or a feature, "
            "kind or category of things"
        )
    try:
        return {str(name): str(parse_type(kind)) for name, kind in data.items()}
    except BadType as wrong:
        raise BadSkillFile(f"{where}: `parameters`: {wrong}") from None


def _says(value: Any, parameters: Mapping[str, str], where: str) -> tuple[str, ...]:
    """Frames in which people ask for a skill."""
    if not isinstance(value, list) or not all(isinstance(v, str) and v.strip() for v in value):
        raise BadSkillFile(f"{where} must be a list of phrases such as `wash {{object}} [up]`")
    for text in value:
        for slot in re.findall(r"\{([^}]*)\}", text):
            if slot not in parameters:
                raise BadSkillFile(
                    f"{where}: {text!r} names {slot!r}, which is not a parameter; "
                    f"those are {', '.join(parameters)}"
                )
        if not re.match(r"[^\W\d_]", text):
            raise BadSkillFile(f"{where}: {text!r} must begin with a verb")
    return tuple(value)


def _list_of_text(value: Any, where: str) -> list[str]:
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise BadSkillFile(f"{where} must be a list of conditions such as `at(robot) = place`")
    return value


def _plain(text: str, parameters: Mapping[str, str], where: str) -> Literal | None:
    """The literal, if the text is no more than that."""
    literal = parse_literal(text)
    if (
        literal is None
        or literal.variable.relation in KEYWORDS
        or (isinstance(literal.value, str) and not literal.value.isidentifier())
    ):
        return None
    if (subject := literal.variable.subject) not in parameters:
        raise BadSkillFile(
            f"{where}: {text!r} speaks of {subject!r}, which is not a parameter; "
            f"those are {', '.join(parameters)}"
        )
    return literal


def _conditions(
    texts: Iterable[str], parameters: Mapping[str, str], where: str
) -> tuple[tuple[Literal, ...], tuple[Formula, ...]]:
    literals, formulas = [], []
    for text in texts:
        if _SPACE.match(text):
            continue
        if (literal := _plain(text, parameters, where)) is not None:
            literals.append(literal)
            continue
        try:
            formulas.append(parse_formula(text, parameters))
        except BadFormula as wrong:
            raise BadSkillFile(f"{where}: {wrong}") from None
    return tuple(literals), tuple(formulas)


def _effects(
    texts: Iterable[str], parameters: Mapping[str, str], where: str
) -> tuple[tuple[Literal, ...], tuple[ConditionalEffect, ...]]:
    literals: list[Literal] = []
    effects: list[ConditionalEffect] = []
    for text in texts:
        literal = _plain(text, parameters, where)
        if literal is None:
            try:
                effect = parse_effect(text, parameters)
            except BadFormula as wrong:
                raise BadSkillFile(f"{where}: {wrong}") from None
            if effect.each or effect.add is not None or effect.when != TRUE:
                effects.append(effect)
                continue
            literal = Literal(effect.variable, effect.value)
        literal = _written(literal, parameters)
        (relation, subject), value = literal
        if relation in DERIVED:
            raise BadSkillFile(f"{where}: {text!r} is read off where things are, and no effect")
        if relation == AT and value == subject:
            raise BadSkillFile(f"{where}: {text!r} would put {subject} into itself")
        others = (one.value for one in literals if one.variable == literal.variable)
        if (other := next(others, value)) != value:
            raise BadSkillFile(
                f"{where}: {text!r} and {relation}({subject}) = {render_value(other)} "
                "cannot both hold"
            )
        literals.append(literal)
    return tuple(literals), tuple(effects)


def _written(literal: Literal, parameters: Mapping[str, str]) -> Literal:
    """What is on or in a thing is at it: one variable says where something is."""
    (relation, subject), value = literal
    carrier = parameters.get(value) if isinstance(value, str) else None
    if relation in (ON, IN) and carrier is not None and OBJECT in parse_type(carrier).bases:
        return Literal(FactKey(AT, subject), value)
    return literal


def _needs(data: Any, parameters: Mapping[str, str], where: str) -> dict[str, tuple[Need, ...]]:
    if not isinstance(data, dict):
        raise BadSkillFile(f"{where}: `needs` must map robot parameters to lists of capabilities")
    needs: dict[str, tuple[Need, ...]] = {}
    for parameter, rows in data.items():
        if parameters.get(parameter) != ROBOT:
            raise BadSkillFile(f"{where}: `needs` names {parameter!r}, which is no robot parameter")
        found = []
        for text in _list_of_text(rows, f"{where}: `needs`"):
            match = _NEED.match(text)
            if match is None or (match[2] and not _measures(match[2], match[3], parameters)):
                raise BadSkillFile(
                    f"{where}: {text!r} must look like `drive`, `grip >= mass(object)` or "
                    "`reach >= height(place)`"
                )
            found.append(Need(match[1], match[2], match[3]))
        needs[parameter] = tuple(found)
    return needs


def _measures(measure: str, of: str, parameters: Mapping[str, str]) -> bool:
    """Whether all that the parameter may stand for can be measured so."""
    return of in parameters and parse_type(parameters[of]).bases == (MEASURES.get(measure),)
