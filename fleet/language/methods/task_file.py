"""Task files: YAML read into compound tasks, with sentences on what is wrong in them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from fleet.errors import BadTaskFile
from fleet.language.methods.model import (
    NUMBER,
    SKILL_NEED,
    SLOT,
    CompoundTask,
    Method,
)
from fleet.language.methods.patterns import BadPhrase, rows_of, slots_of
from fleet.language.words.tokens import NUMBERS
from keyexpr_schema.yaml_reader import YamlFile, line_in

_METHOD = ("do", "in_order", "needs")
_FIELDS = ("about", "says", "defaults", "yields", "methods", "do", "in_order", "needs")
_NAME = re.compile(r"[^\W\d]\w*")
_NEED = re.compile(r"(?:(\d+|\{\w+\})\s+)?\w+(?:\s*[&|]\s*\w+)*")


def tasks_from_data(data: Any, where: str | YamlFile) -> tuple[CompoundTask, ...]:
    """Compound tasks from the parsed YAML of a task file; `where` names the file in errors.

    Raises:
        BadTaskFile: one sentence that names file, task and field, and says what would be right.
    """
    if not isinstance(data, dict) or not isinstance(data.get("tasks"), dict):
        raise BadTaskFile(f"{where}: there must be a mapping `tasks:` of names to tasks")
    if unknown := set(map(str, data)) - {"tasks"}:
        raise BadTaskFile(f"{where} has no field {min(unknown)!r}; its one field is tasks")
    return tuple(
        _task(name, task, f"{where}{line_in(where, f'tasks.{name}')}: task {name}", str(where))
        for name, task in data["tasks"].items()
    )


def _task(name: Any, data: Any, where: str, file: str) -> CompoundTask:
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise BadTaskFile(f"{where}: its name must be one word such as set_the_table")
    data = _mapping(data, _FIELDS, where)
    says = _texts(data.get("says"), f"{where}: `says`", "set the table for {n: number}")
    types = _types(says, where)
    defaults = _defaults(data.get("defaults", {}), types, f"{where}: `defaults`")
    given = {*defaults} | {
        slot for slot in types if all(slot in _always_said(text) for text in says)
    }
    yields = data.get("yields", False)
    if not isinstance(yields, bool):
        raise BadTaskFile(f"{where}: `yields` must be true or false, not {yields!r}")
    if "methods" in data:
        if both := [key for key in _METHOD if key in data]:
            raise BadTaskFile(
                f"{where}: `{both[0]}` stands inside of `methods` where there are any"
            )
        rows = data["methods"]
        if not isinstance(rows, list) or not rows:
            raise BadTaskFile(f"{where}: `methods` must be a list, the first choice first")
        methods = [
            _method(
                _mapping(row, _METHOD, f"{where}: method {n}"), given, types, f"{where}: method {n}"
            )
            for n, row in enumerate(rows, 1)
        ]
    else:
        methods = [_method(data, given, types, where)]
    return CompoundTask(
        name=name,
        says=says,
        methods=tuple(methods),
        about=str(data.get("about", "")),
        defaults=defaults,
        file=file,
        yields=yields,
    )


def _always_said(phrase: str) -> set[str]:
    """The parameters that are said whenever a phrase is."""
    rows = rows_of(phrase)
    named = [{part.name for part in row if not isinstance(part, str)} for row in rows]
    return set.intersection(*named)


def _mapping(data: Any, fields: tuple[str, ...], where: str) -> Mapping[str, Any]:
    if not isinstance(data, dict):
        raise BadTaskFile(f"{where} must be a mapping with {', '.join(fields)}")
    if unknown := [key for key in data if key not in fields]:
        raise BadTaskFile(
            f"{where} has no field {str(unknown[0])!r}; its fields are {', '.join(fields)}"
        )
    return data


def _texts(value: Any, where: str, example: str) -> tuple[str, ...]:
    if isinstance(value, str):
        value = [value]
    if not isinstance(value, list) or not value or not all(
        isinstance(text, str) and text.strip() for text in value
    ):  # fmt: skip
        raise BadTaskFile(f"{where} must be a list of texts such as {example!r}")
    return tuple(" ".join(text.split()) for text in value)


def _types(says: tuple[str, ...], where: str) -> dict[str, str]:
    types: dict[str, str] = {}
    for text in says:
        try:
            rows_of(text)
        except BadPhrase as wrong:
            raise BadTaskFile(f"{where}: `says`: {text!r} {wrong}") from None
        for name, of in slots_of(text).items():
            if not of or not _NEED.fullmatch(of):
                raise BadTaskFile(
                    f"{where}: `says`: {text!r} must say what {{{name}}} is: number, place, "
                    f"person, robot, object, or a kind of things, as in {{{name}: number}}"
                )
            if types.setdefault(name, of) != of:
                raise BadTaskFile(f"{where}: `says`: {{{name}}} is a {types[name]} and a {of}")
    return types


def _defaults(data: Any, types: Mapping[str, str], where: str) -> dict[str, str]:
    if not isinstance(data, dict):
        raise BadTaskFile(f"{where} must be a mapping of parameters to what is meant without them")
    for name, value in data.items():
        if name not in types:
            known = ", ".join(types) or "none"
            raise BadTaskFile(f"{where} names {name!r}, which no phrase has; those are {known}")
        if types[name] == NUMBER and not _is_count(value):
            raise BadTaskFile(f"{where}: {name} must be a number from 1 up, not {value!r}")
    return {name: NUMBERS.get(str(value), str(value)) for name, value in data.items()}


def _is_count(value: Any) -> bool:
    text = NUMBERS.get(str(value), str(value))
    return not isinstance(value, bool) and text.isdecimal() and int(text) > 0


def _method(
    data: Mapping[str, Any], given: set[str], types: Mapping[str, str], where: str
) -> Method:
    if ("do" in data) == ("in_order" in data):
        raise BadTaskFile(
            f"{where} must say what it means: `do` (side by side) or `in_order` (one after the "
            "other), a list of sentences, and not both"
        )
    example = "switch on the lamp"
    if "do" in data:
        rows = [_texts(data["do"], f"{where}: `do`", example)]
    else:
        listed = data["in_order"]
        if not isinstance(listed, list) or not listed:
            raise BadTaskFile(
                f"{where}: `in_order` must be a list of sentences (or of lists of those that are "
                f"done side by side) such as {example!r}"
            )
        rows = [_texts(row, f"{where}: `in_order`", example) for row in listed]
    needs = _texts(data["needs"], f"{where}: `needs`", "2 plate") if "needs" in data else ()
    for need in needs:
        if not re.fullmatch(rf"{SKILL_NEED} \w+", need) and not _NEED.fullmatch(need):
            raise BadTaskFile(
                f"{where}: `needs`: {need!r} must look like `plate`, `2 cup | glass`, "
                "`{n} movable & dish` or `skill wash`"
            )
    for text in (*needs, *(text for row in rows for text in row)):
        for name, _ in SLOT.findall(text):
            if name not in given:
                more = (
                    "which a phrase can leave out: say it in `defaults`"
                    if name in types
                    else f"which no phrase has; those are {', '.join(types) or 'none'}"
                )
                raise BadTaskFile(f"{where}: {text!r} names {{{name}}}, {more}")
        if "{" in SLOT.sub("", text) or "}" in SLOT.sub("", text):
            raise BadTaskFile(f"{where}: {text!r} has a brace that stands for no parameter")
    spoken_of = {name for row in rows for text in row for name, _ in SLOT.findall(text)}
    if unsaid := [name for name in types if name not in spoken_of]:
        raise BadTaskFile(
            f"{where}: what it means says nothing of {{{unsaid[0]}}}, which its phrases name: no "
            "meaning is dropped"
        )
    return Method(do=tuple(rows), needs=needs)
