"""What a YAML file holds, as a typed struct; or one sentence on what is wrong and where."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import msgspec.inspect

from keyexpr_schema.key import plainly
from keyexpr_schema.yaml_reader import YamlFile, read_yaml_file

S = TypeVar("S", bound=msgspec.Struct)
Steps = tuple[str | int, ...]
"""Names and numbers that lead to a place in a document."""

UNITS = {
    "_m": "lengths are in metres; is this in centimetres?",
    "_kg": "masses are in kilograms; is this in grams?",
    "_s": "times are in seconds; is this in milliseconds?",
}
"""What may be the reason why a number is too large, by how its field's name ends."""

_WORDS = (
    ("object contains unknown field", "there is no field"),
    ("object missing required field", "it lacks the field"),
    ("`object`", "a group of `name: value` lines"),
    ("`array`", "a list"),
    ("`str`", "text"),
    ("`float`", "a number"),
    ("`int`", "a whole number"),
    ("`bool`", "true or false"),
    (">= ", "of at least "),
    ("<= ", "of at most "),
    ("> ", "greater than "),
    ("< ", "less than "),
)
"""How msgspec puts it, and how a person would."""

_STEP = re.compile(r"\.([^.\[]+)|\[([0-9]+)\]")
LONGEST_VALUE = 40


def read_typed(path: Path, kind: type[S], what: str, error: type[Exception]) -> tuple[S, YamlFile]:
    """The file at `path` as a `kind`, and where in it what stands.

    `what` names it in messages ("world file").

    Raises:
        error: it is missing, not YAML, or not a `kind`; one sentence.
    """
    try:
        there = path.exists()
    except (OSError, ValueError):
        there = False  # nothing can be called so
    if not there:
        raise error(f"the {what} {path} does not exist")
    file = read_yaml_file(path, error)
    return typed(file, kind, what, error), file


def typed(file: YamlFile, kind: type[S], what: str, error: type[Exception], section: str = "") -> S:
    """What a file (or the `section` of it) holds as a `kind`; an unknown field is an error.

    Raises:
        error: it is none; one sentence that names file, line and place.
    """
    raw = file.data[section] if section else file.data

    def at(place: str) -> str:
        return file.at(f"{section}.{place}".strip(".") if section else place)

    if not isinstance(raw, dict):
        raise error(f"{at('')}: a {what} is a list of `name: value` lines, and this is none")
    names = kind.__struct_encode_fields__
    if unknown := [name for name in raw if name not in names]:
        raise error(f"{at(unknown[0])}: {_no_field(names)}")
    try:
        read = msgspec.convert(raw, kind)
    except msgspec.ValidationError as wrong:
        message, steps = _located(wrong, raw, kind)
        choices = _choices(kind, steps)
        message = _sentence(message, steps, raw, bool(choices)) + choices
        raise error(f"{at(_place(steps))}: {message}") from None
    if (found := _unknown_field(raw, read, ())) is not None:
        steps, fields = found
        raise error(f"{at(_place(steps))}: {_no_field(fields)}")
    return read


def _located(wrong: msgspec.ValidationError, raw: Any, kind: type[Any]) -> tuple[str, Steps]:
    """What is wrong and where, of `raw` that is no `kind`.

    msgspec writes `[...]` for any name of a mapping: which one it was is found by leaving only one.
    """
    names: list[str] = []
    while True:
        message, _, at = plainly(wrong).partition(" - at `")
        name_itself = at.startswith("key")
        parts = at.rstrip("`").rpartition("$")[2].split("[...]")
        steps: list[str | int] = []
        for number, part in enumerate(parts):
            steps += (int(index) if index else name for name, index in _STEP.findall(part))
            if number == len(names):
                break
            if number < len(parts) - 1 or name_itself:
                steps.append(names[number])
        if len(names) == len(parts) - (not name_itself):
            return message, tuple(steps)
        mapping = _value_at(raw, steps)
        for name in mapping:
            alone = _with(raw, steps, {name: mapping[name]})
            try:
                msgspec.convert(alone, kind)
            except msgspec.ValidationError as found:
                if plainly(found).partition(" - at `")[2] != at:
                    continue  # what is wrong elsewhere, and is seen now that this is not
                names.append(name)
                wrong, raw = found, alone
                break
        else:
            return message, tuple(steps)


def _value_at(raw: Any, steps: Sequence[str | int]) -> Any:
    for step in steps:
        raw = raw[step]
    return raw


def _with(raw: Any, steps: Sequence[str | int], value: Any) -> Any:
    """`raw` with another value at that place."""
    if not steps:
        return value
    changed = raw.copy()
    changed[steps[0]] = _with(raw[steps[0]], steps[1:], value)
    return changed


def _place(steps: Steps) -> str:
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps)[1:]


def _no_field(fields: Iterable[str]) -> str:
    return f"there is no such field; valid are: {', '.join(fields)}"


def _sentence(message: str, steps: Steps, raw: Any, choices: bool) -> str:
    message = message[0].lower() + message[1:]
    for spoken, plain in _WORDS:
        message = message.replace(spoken, plain)
    try:
        value = _value_at(raw, steps)
    except (LookupError, TypeError):
        return message
    if isinstance(value, str) and message.endswith("got text"):
        message += f" {value!r}" if len(value) <= LONGEST_VALUE else ""
    elif message.startswith("expected text, got") and isinstance(value, bool | int | float):
        if choices:
            return message
        message += f"; put it in quotes: '{str(value).lower()}'"
    field = next((step for step in reversed(steps) if isinstance(step, str)), "")
    if message.startswith("expected") and ", got" not in message and not isinstance(value, dict):
        message += f", got {value!r}"
    if " of at most " in message:
        message += "".join(f"; {why}" for unit, why in UNITS.items() if field.endswith(unit))
    return message


def _choices(kind: type[Any], steps: Steps) -> str:
    """What may stand at a place, where that is one of a few words."""
    nodes: list[Any] = [msgspec.inspect.type_info(kind)]
    for step in (*steps, None):
        nodes = [inner for node in nodes for inner in getattr(node, "types", (node,))]
        if step is None:
            break
        below: list[Any] = []
        for node in nodes:
            if isinstance(node, msgspec.inspect.StructType):
                below += (f.type for f in node.fields if f.encode_name == step)
            elif isinstance(node, msgspec.inspect.TupleType) and isinstance(step, int):
                below += node.item_types[step : step + 1]
            else:
                item = getattr(node, "value_type", getattr(node, "item_type", None))
                below += () if item is None else (item,)
        nodes = below
    words = [
        str(word)
        for node in nodes
        for word in (
            [each.value for each in node.cls]
            if isinstance(node, msgspec.inspect.EnumType)
            else getattr(node, "values", ())
        )
    ]
    return f"; it is one of {', '.join(words)}" if words else ""


def _unknown_field(raw: Any, read: Any, steps: Steps) -> tuple[Steps, Sequence[str]] | None:
    """A field that payloads leave out as they decode is a slip of the pen in a file."""
    if isinstance(read, msgspec.Struct) and isinstance(raw, dict):
        names = type(read).__struct_fields__
        fields = dict(zip(type(read).__struct_encode_fields__, names, strict=True))
        inner = {name: getattr(read, fields[name]) for name in raw if name in fields}
        tag = read.__struct_config__.tag_field
        if unknown := [name for name in raw if name not in fields and name != tag]:
            return (*steps, unknown[0]), list(fields)
    elif isinstance(read, Mapping) and isinstance(raw, dict):
        inner = {name: read[name] for name in raw if name in read}
    elif isinstance(read, tuple) and isinstance(raw, list):
        inner = dict(enumerate(read))
    else:
        return None
    for step, value in inner.items():
        if (found := _unknown_field(raw[step], value, (*steps, step))) is not None:
            return found
    return None
