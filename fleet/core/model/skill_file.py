"""Skill files: YAML read into skill models, with sentences on what is wrong in them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from fleet.core.model.skills import MEASURES, PARAMETER_TYPES, SPACE, Need, SkillModel
from fleet.errors import BadSkillFile
from keyexpr_schema.facts import Literal, parse_literal

_SPACE = re.compile(rf"^\s*{SPACE}\(\s*(\w+)\s*\)\s*$")
_NEED = re.compile(r"^\s*(\w+)(?:\s*>=\s*(\w+)\(\s*(\w+)\s*\))?\s*$")
_FIELDS = frozenset({"about", "parameters", "needs", "before", "after", "duration_s", "travel_to"})


def skills_from_data(data: Any, where: str) -> dict[str, SkillModel]:
    """Skill models from the parsed YAML of a skill file; `where` names the file in errors.

    Raises:
        BadSkillFile: one sentence that names skill and field, and says what would be right.
    """
    if not isinstance(data, dict) or not isinstance(data.get("skills"), dict):
        raise BadSkillFile(f"{where}: there must be a mapping `skills:` of skill names to models")
    return {
        str(name): _skill(str(name), model, f"{where}: skill {name}")
        for name, model in data["skills"].items()
    }


def _skill(name: str, model: Any, where: str) -> SkillModel:
    if not isinstance(model, dict):
        raise BadSkillFile(f"{where} must be a mapping with {', '.join(sorted(_FIELDS))}")
    if unknown := set(model) - _FIELDS:
        raise BadSkillFile(
            f"{where} has no field {', '.join(sorted(map(str, unknown)))}; "
            f"its fields are {', '.join(sorted(_FIELDS))}"
        )
    parameters = model.get("parameters")
    if not isinstance(parameters, dict) or not all(
        kind in PARAMETER_TYPES for kind in parameters.values()
    ):
        raise BadSkillFile(
            f"{where}: `parameters` must map names to one of {', '.join(PARAMETER_TYPES)}"
        )
    if "robot" not in parameters.values():
        raise BadSkillFile(f"{where} needs a parameter of type robot: the one that does it")
    duration = model.get("duration_s", 10.0)
    if isinstance(duration, bool) or not isinstance(duration, int | float) or duration < 0:
        raise BadSkillFile(f"{where}: `duration_s` must be a number of seconds, not {duration!r}")
    travel_to = model.get("travel_to")
    if travel_to is not None and parameters.get(travel_to) != "place":
        raise BadSkillFile(f"{where}: `travel_to` must name a parameter of type place")
    before_text = _list_of_text(model.get("before", []), f"{where}: `before`")
    space_in = tuple(m[1] for text in before_text if (m := _SPACE.match(text)))
    for subject in space_in:
        if parameters.get(subject) != "robot":
            raise BadSkillFile(f"{where}: {SPACE}({subject}) must name a parameter of type robot")
    after_text = _list_of_text(model.get("after", []), f"{where}: `after`")
    return SkillModel(
        name=name,
        about=str(model.get("about", "")),
        parameters=parameters,
        needs=_needs(model.get("needs", {}), parameters, where),
        before=tuple(
            _condition(text, parameters, f"{where}: `before`")
            for text in before_text
            if not _SPACE.match(text)
        ),
        after=tuple(_condition(text, parameters, f"{where}: `after`") for text in after_text),
        space_in=space_in,
        duration_s=float(duration),
        travel_to=travel_to,
    )


def _list_of_text(value: Any, where: str) -> list[str]:
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise BadSkillFile(f"{where} must be a list of conditions such as `at(robot) = place`")
    return value


def _condition(text: str, parameters: Mapping[str, str], where: str) -> Literal:
    literal = parse_literal(text)
    if literal is None:
        raise BadSkillFile(f"{where}: {text!r} must look like `at(robot) = place`")
    if (subject := literal.variable.subject) not in parameters:
        raise BadSkillFile(
            f"{where}: {text!r} speaks of {subject!r}, which is not a parameter; "
            f"those are {', '.join(parameters)}"
        )
    return literal


def _needs(data: Any, parameters: Mapping[str, str], where: str) -> dict[str, tuple[Need, ...]]:
    if not isinstance(data, dict):
        raise BadSkillFile(f"{where}: `needs` must map robot parameters to lists of capabilities")
    needs: dict[str, tuple[Need, ...]] = {}
    for parameter, rows in data.items():
        if parameters.get(parameter) != "robot":
            raise BadSkillFile(f"{where}: `needs` names {parameter!r}, which is no robot parameter")
        found = []
        for text in _list_of_text(rows, f"{where}: `needs`"):
            match = _NEED.match(text)
            if match is None or (
                match[2] and parameters.get(match[3], "nothing") != MEASURES.get(match[2])
            ):
                raise BadSkillFile(
                    f"{where}: {text!r} must look like `drive`, `grip >= mass(object)` or "
                    "`reach >= height(place)`"
                )
            found.append(Need(match[1], match[2], match[3]))
        needs[parameter] = tuple(found)
    return needs
