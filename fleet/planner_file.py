"""The planner's configuration file: which sections it has, and what stands in one."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import msgspec

from fleet.errors import FleetError
from keyexpr_schema.typed_yaml import typed
from keyexpr_schema.yaml_reader import read_yaml_file

SECTIONS = ("llm", "language")
T = TypeVar("T", bound=msgspec.Struct)


def planner_section(path: Path, name: str, kind: type[T], error: type[FleetError]) -> T:
    """The section `name` of the file at `path`, as a `kind`; of none, all is as it is by default.

    Raises:
        error: the file cannot be read, has other sections, or a field is not right; one sentence.
    """
    file = read_yaml_file(path, error)
    data = file.data
    if not isinstance(data, dict) or not data or set(data) - set(SECTIONS):
        sections = " and ".join(f"`{section}`" for section in SECTIONS)
        raise error(f"{path} must have sections {sections}, with fields such as `llm: model`")
    return typed(file, kind, "section", error, section=name) if name in data else kind()
