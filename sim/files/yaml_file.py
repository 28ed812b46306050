"""Reads a YAML file into a typed struct, or says in one sentence what is wrong and where."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

import msgspec

from keyexpr_schema.config_files import check_names, config_file
from keyexpr_schema.errors import NoConfigFile
from keyexpr_schema.key import plainly
from sim.errors import BadFile

S = TypeVar("S", bound=msgspec.Struct)


class FileEntry(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of what stands in a configuration file: an unknown field is an error, not a wish."""


def find_file(kind: str, name: str | Path, named_in: Path | None = None) -> Path:
    """See `config_file`; a name of no file is a `BadFile`."""
    try:
        return config_file(kind, name, named_in)
    except NoConfigFile as error:
        raise BadFile(str(error)) from None


def read_yaml(path: Path, kind: type[S], what: str) -> S:
    """The file at `path` as a `kind`; `what` names it in messages ("world file").

    Raises:
        BadFile: it is missing, not YAML, or not a `kind`.
    """
    import yaml

    class Loader(yaml.SafeLoader):
        """YAML 1.2's booleans: in 1.1, which is PyYAML's, the words `on` and `no` are some too."""

        yaml_implicit_resolvers = {
            first: [(tag, rule) for tag, rule in rules if tag != "tag:yaml.org,2002:bool"]
            for first, rules in yaml.SafeLoader.yaml_implicit_resolvers.items()
        }

        def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
            check_names(node)
            return super().construct_mapping(node, deep)

    Loader.add_implicit_resolver(
        "tag:yaml.org,2002:bool", re.compile(r"^(?:true|True|false|False)$"), list("tTfF")
    )
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise BadFile(f"the {what} {path} does not exist") from None
    except (OSError, UnicodeDecodeError) as error:
        raise BadFile(f"the {what} {path} cannot be read: {error}") from None
    try:
        raw = yaml.load(text, Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" line {mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or str(error)
        raise BadFile(f"{path}{where}: this is not YAML: {problem}") from None
    if not isinstance(raw, dict):
        raise BadFile(f"{path}: a {what} is a list of `name: value` lines, and this is none")
    fields = {field.encode_name for field in msgspec.structs.fields(kind)}
    if unknown := sorted(str(name) for name in raw if name not in fields):
        raise BadFile(
            f"{path}: {what}s have no field {unknown[0]!r}; they have {', '.join(sorted(fields))}"
        )
    try:
        return msgspec.convert(raw, kind)
    except msgspec.ValidationError as error:
        raise BadFile(_sentence(path, error, raw, kind)) from None


def _sentence(
    path: Path, error: msgspec.ValidationError, raw: Mapping[Any, Any], kind: type[msgspec.Struct]
) -> str:
    """msgspec writes `[...]` for a key of a mapping: find out which key it was."""
    place = ""
    for field in msgspec.structs.fields(kind):
        name, hint = field.encode_name, field.type
        value = raw.get(name)
        if get_origin(hint) is not dict or not isinstance(value, dict):
            continue
        key_kind, entry_kind = get_args(hint)
        for key, entry in value.items():
            for part, part_kind in ((key, key_kind), (entry, entry_kind)):
                try:
                    msgspec.convert(part, part_kind)
                except msgspec.ValidationError as inner:
                    error, place = inner, f"{name}.{key}"
                    break
            if place:
                break
        if place:
            break
    message, _, below = plainly(error).partition(" - at `$")
    where = (place + below.rstrip("`")).lstrip(".")
    message = message[0].lower() + message[1:]
    for spoken, plain in _WORDS:
        message = message.replace(spoken, plain)
    return f"{path}: {where}: {message}" if where else f"{path}: {message}"


_WORDS = (
    ("object contains unknown field", "there is no field"),
    ("object missing required field", "it lacks the field"),
    ("`object`", "a group of `name: value` lines"),
    ("`array`", "a list"),
    ("`str`", "text"),
    ("`float`", "a number"),
    ("`int`", "a whole number"),
    ("`bool`", "true or false"),
)
"""How msgspec puts it, and how a person would."""
