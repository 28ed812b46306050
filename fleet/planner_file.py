"""The planner's configuration file: which sections it has, and what stands in one."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import TypeVar

import msgspec

from fleet.errors import FleetError
from keyexpr_schema.config_files import read_yaml

SECTIONS = ("llm", "language")
T = TypeVar("T", bound=msgspec.Struct)


def planner_section(path: Path, name: str, kind: type[T], error: type[FleetError]) -> T:
    """The section `name` of the file at `path`, as a `kind`; of none, all is as it is by default.

    Raises:
        error: the file cannot be read, has other sections, or a field is not right; one sentence.
    """
    data = read_yaml(path, error)
    if not isinstance(data, dict) or not data or set(data) - set(SECTIONS):
        sections = " and ".join(f"`{section}`" for section in SECTIONS)
        raise error(f"{path} must have sections {sections}, with fields such as `llm: model`")
    section = data.get(name, {})
    if not isinstance(section, dict):
        raise error(f"{path}: `{name}` must have fields, such as {_example(kind)}")
    fields = {field.name for field in msgspec.structs.fields(kind)}
    if unknown := sorted(str(field) for field in section if field not in fields):
        raise error(
            f"{path}: `{name}` has no field {unknown[0]}; its fields are "
            f"{', '.join(sorted(fields))}"
        )
    try:
        return msgspec.convert(section, kind)
    except msgspec.ValidationError as wrong:
        reason = str(wrong).replace("`$.", f"`{name}.").replace(" - at `$`", "")
        raise error(f"{path}: {reason}{_choices(kind, str(wrong))}") from None


def _choices(kind: type[msgspec.Struct], wrong: str) -> str:
    """What may stand in the field that is wrong, where that is one of a few words."""
    for field in msgspec.structs.fields(kind):
        of_words = isinstance(field.type, type) and issubclass(field.type, Enum)
        if of_words and f"`$.{field.name}`" in wrong:
            return f"; it is one of {', '.join(str(word.value) for word in field.type)}"
    return ""


def _example(kind: type[msgspec.Struct]) -> str:
    return f"`{msgspec.structs.fields(kind)[0].name}`"
