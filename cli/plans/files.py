"""A plan as a file that a person can read, edit and give back."""

from __future__ import annotations

from pathlib import Path

import msgspec
import yaml

from cli.errors import BadFile
from keyexpr_schema.config_files import read_yaml
from keyexpr_schema.payloads.plans import Plan

SUFFIXES = (".yaml", ".yml", ".json")


def is_plan_file(name: str) -> bool:
    """Whether `name` is meant as a file and not as a plan's id, which has neither of these."""
    return "/" in name or name.endswith(SUFFIXES)


def read_plan(path: Path) -> Plan:
    """The plan in a YAML or JSON file, in the form of its payload; unknown fields are errors.

    Raises:
        BadFile: it cannot be read or is no plan; the message names the file and the place in it.
    """
    data = read_yaml(path, BadFile)
    if not isinstance(data, dict):
        raise BadFile(
            f"{path} is not a plan: it must hold fields such as plan, goals, conditions, tasks"
        )
    try:
        plan = msgspec.convert(data, Plan)
    except msgspec.ValidationError as error:
        raise BadFile(f"{path}: {_in_the_file(error)}") from None
    _no_unknown_fields(path, data, plan)
    return plan


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
        text = yaml.dump(
            _lean(plan),
            Dumper=_Dumper,
            sort_keys=False,
            allow_unicode=True,
            default_flow_style=None,
            width=100,
        )
    path.write_text(text, encoding="utf-8")


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


class _Dumper(yaml.SafeDumper):
    """YAML without anchors: what is said twice is written twice."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def _in_the_file(error: msgspec.ValidationError) -> str:
    """`tasks[2].skill: Expected …` from msgspec's `Expected … - at `$.tasks[2].skill``."""
    what, _, where = str(error).partition(" - at `$")
    return f"{where.rstrip('`').lstrip('.')}: {what}" if where.strip("`") else what


def _no_unknown_fields(path: Path, data: object, read: object, where: str = "") -> None:
    """A field that a payload does not have is a slip of the pen in a file that a person writes."""
    if isinstance(read, msgspec.Struct) and isinstance(data, dict):
        names = [field.encode_name for field in msgspec.structs.fields(read)]
        for name, value in data.items():
            if name not in names:
                raise BadFile(
                    f"{path}: {where}{name}: there is no such field; valid are: {', '.join(names)}"
                )
            _no_unknown_fields(path, value, getattr(read, name), f"{where}{name}.")
    elif isinstance(read, tuple) and isinstance(data, list):
        for number, (value, each) in enumerate(zip(data, read, strict=True)):
            _no_unknown_fields(path, value, each, f"{where.rstrip('.')}[{number}].")
