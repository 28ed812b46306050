"""A plan as a file that a person can read, edit and give back."""

from __future__ import annotations

from pathlib import Path

import msgspec

from cli.errors import BadFile
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.typed_yaml import typed
from keyexpr_schema.whole_files import write_whole
from keyexpr_schema.yaml_reader import read_yaml_file, written_yaml

SUFFIXES = (".yaml", ".yml", ".json")


def is_plan_file(name: str) -> bool:
    """Whether `name` is meant as a file and not as a plan's id, which has neither of these."""
    return "/" in name or name.endswith(SUFFIXES)


def read_plan(path: Path) -> Plan:
    """The plan in a YAML or JSON file, in the form of its payload; unknown fields are errors.

    Raises:
        BadFile: it cannot be read or is no plan; the message names the file and the place in it.
    """
    return typed(read_yaml_file(path, BadFile), Plan, "plan", BadFile)


def check_suffix(path: Path) -> None:
    """Raise `BadFile` unless the name says in which form the plan is written."""
    if path.suffix not in SUFFIXES:
        raise BadFile(f"{path}: a plan is written as {', '.join(SUFFIXES)}; choose one of these")


def write_plan(path: Path, plan: Plan) -> None:
    """Write `plan` as JSON if the name ends in .json, else as YAML; defaults are left out.

    Raises:
        BadFile: the name ends in neither .json nor .yaml.
        OSError: it cannot be written.
    """
    check_suffix(path)
    if path.suffix == ".json":
        text = msgspec.json.format(msgspec.json.encode(_lean(plan)), indent=2).decode() + "\n"
    else:
        text = written_yaml(_lean(plan))
    write_whole(path, text.encode())


def _lean(value: object) -> object:
    """Builtins without the fields that say what their payload takes for granted."""
    if isinstance(value, msgspec.Struct):
        return {
            field.encode_name: _lean(getattr(value, field.name))
            for field in msgspec.structs.fields(value)
            if field.required or getattr(value, field.name) != _default(field)
        }
    if isinstance(value, list | tuple):
        return [_lean(each) for each in value]
    return msgspec.to_builtins(value)


def _default(field: msgspec.structs.FieldInfo) -> object:
    made = field.default_factory
    return field.default if made is msgspec.NODEFAULT else made()
