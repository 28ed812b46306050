"""The one reader of YAML (and JSON) files that people write: careful, bounded, and by YAML 1.2.

PyYAML's own loaders go by YAML 1.1, where `045` is 37, `1:15` is 75, `15e-2` is text, `no` is false
and `2026-02-30` is a traceback; and of a name that comes twice they forget the first. Here scalars
are what the core schema of YAML 1.2 says (https://yaml.org/spec/1.2.2/#103-core-schema) and as a
person means them: `045` is 45, `15e-2` is 0.15, only `true` and `false` are booleans, and all that
looks like a date or a time of day is text. Names of a mapping are text as they are written.

Refused, in one sentence with file and line: names that come twice, numbers that are none (`.nan`,
`.inf`, `1e999`), control characters in texts, tags of programs, several documents, and files that
would take up the machine: large, deeply nested, or grown by aliases.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from keyexpr_schema.control_characters import first_control_character
from keyexpr_schema.decoding import LARGEST_INTEGER

LARGEST_BYTES = 16_000_000
"""A plan of 20,000 tasks has 6 MB."""
MOST_VALUES = 1_000_000
DEEPEST = 64
LONGEST_PLACE = 80
"""Characters; what is nested deeper than that is told by its line alone."""
LONGEST_NUMBER = 400
"""Digits; the largest fraction has 309 before its point."""

_PARSER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""libyaml's is ten times as fast; what is built of its events is not its concern."""

_NULL = frozenset({"", "~", "null", "Null", "NULL"})
_BOOL = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_INT = re.compile(r"[-+]?[0-9]+")
_BASED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_NO_NUMBER = re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
_CORE = "tag:yaml.org,2002:"
_TAGS = frozenset(_CORE + kind for kind in ("str", "int", "float", "bool", "null", "seq", "map"))
_MERGE = "<<"


class _Wrong(Exception):
    """What is wrong in a file, the mark where, and the place in the document."""

    place = ""

    def __init__(self, problem: str, mark: Any) -> None:
        super().__init__(problem)
        self.problem, self.mark = problem, mark


@dataclass
class _Open:
    """A mapping or list that is being read; `name` is that of the entry under way."""

    value: Any
    place: str
    anchor: str | None
    values_before: int
    name: str | None = None
    names: set[str] = field(default_factory=set)
    merged: list[Any] = field(default_factory=list)

    def below(self) -> str:
        """Where the next entry stands in the document: `places.kitchen`, `walls[2]`."""
        if isinstance(self.value, list):
            return f"{self.place}[{len(self.value)}]"
        if self.name is None:
            return self.place
        return f"{self.place}.{self.name}" if self.place else self.name


def scalar(text: str) -> Any:
    """What a scalar without quotes stands for.

    Raises:
        ValueError: it is a number that is none, or has more digits than any; the message says so.
    """
    if text in _NULL:
        return None
    if text in _BOOL:
        return _BOOL[text]
    if len(text) > LONGEST_NUMBER and any(form.fullmatch(text) for form in (_INT, _BASED, _FLOAT)):
        raise ValueError(f"a number of {len(text)} characters is none that can be meant")
    if _INT.fullmatch(text) or _BASED.fullmatch(text):
        whole = int(text, 0 if _BASED.fullmatch(text) else 10)
        if abs(whole) > LARGEST_INTEGER:
            raise ValueError(f"{text} is larger than any number that can be meant")
        return whole
    if _FLOAT.fullmatch(text):
        number = float(text)
        if not math.isfinite(number):
            raise ValueError(f"{text} is larger than any number that can be meant")
        return number
    if _NO_NUMBER.fullmatch(text):
        raise ValueError(f"{text} is no number that can be meant; write a number, or leave it out")
    return text


class _Reading:
    """Builds values of the events of a parser; where each stands goes into `lines`, if wanted."""

    def __init__(self, lines: dict[str, int] | None) -> None:
        self._lines = lines
        self._open: list[_Open] = []
        self._anchors: dict[str, tuple[Any, int]] = {}
        self._values = 0
        self._documents = 0
        self.value: Any = None

    def read(self, event: Any) -> None:
        mark = event.start_mark
        if isinstance(event, yaml.DocumentStartEvent):
            self._documents += 1
            if self._documents > 1:
                raise _Wrong("a second document begins here; write each into its own file", mark)
        elif isinstance(event, yaml.ScalarEvent):
            self._scalar(event)
        elif isinstance(event, yaml.AliasEvent):
            self._alias(event)
        elif isinstance(event, yaml.MappingStartEvent | yaml.SequenceStartEvent):
            self._start(event)
        elif isinstance(event, yaml.MappingEndEvent | yaml.SequenceEndEvent):
            self._end(mark)

    def place(self) -> str:
        """Where in the document the reading is."""
        return self._open[-1].below() if self._open else ""

    def _start(self, event: Any) -> None:
        is_map = isinstance(event, yaml.MappingStartEvent)
        _check_tag(event, ("map",) if is_map else ("seq",))
        top = self._open[-1] if self._open else None
        if top is not None and isinstance(top.value, dict) and top.name is None:
            raise _Wrong("a name must be one word or text, not a list or mapping", event.start_mark)
        if len(self._open) == DEEPEST:
            raise _Wrong(f"it is nested more than {DEEPEST} deep", event.start_mark)
        self._count(1, event.start_mark)
        place = self.place()
        self._note(place, event.start_mark)
        self._open.append(_Open({} if is_map else [], place, event.anchor, self._values - 1))

    def _end(self, mark: Any) -> None:
        ended = self._open.pop()
        for merged in ended.merged:
            for name, value in merged.items():
                ended.value.setdefault(name, value)
        if ended.anchor is not None:
            self._anchors[ended.anchor] = (ended.value, self._values - ended.values_before)
        self._put(ended.value, mark)

    def _scalar(self, event: Any) -> None:
        mark, text = event.start_mark, event.value
        if unprintable := first_control_character(text, lines=True):
            raise _Wrong(f"the text has the control character {unprintable}; leave it out", mark)
        top = self._open[-1] if self._open else None
        if top is not None and isinstance(top.value, dict) and top.name is None:
            _check_tag(event, ("str",))
            self._name(top, text, mark)
            if event.anchor is not None:
                self._anchors[event.anchor] = (text, 1)
            return
        self._count(1, mark)
        self._note(self.place(), mark)
        kind = _check_tag(event, ("str", "int", "float", "bool", "null"))
        try:
            value = scalar(text) if event.implicit[0] or kind not in (None, "str") else text
        except ValueError as error:
            raise _Wrong(str(error), mark) from None
        if kind not in (None, "str") and not _is_of(value, kind):
            raise _Wrong(f"{text!r} is not a {kind}", mark)
        if event.anchor is not None:
            self._anchors[event.anchor] = (value, 1)
        self._put(float(value) if kind == "float" else value, mark)

    def _alias(self, event: Any) -> None:
        mark = event.start_mark
        if event.anchor not in self._anchors:
            raise _Wrong(f"nothing before is called &{event.anchor}, or it is inside that", mark)
        value, size = self._anchors[event.anchor]
        self._count(size, mark)
        top = self._open[-1] if self._open else None
        if top is not None and isinstance(top.value, dict) and top.name is None:
            if not isinstance(value, str):
                raise _Wrong(f"*{event.anchor} is no name", mark)
            self._name(top, value, mark)
            return
        self._put(value, mark)

    def _name(self, top: _Open, name: str, mark: Any) -> None:
        if name in top.names:
            raise _Wrong(f"{name!r} comes twice", mark)
        top.names.add(name)
        top.name = name
        self._note(top.below(), mark)

    def _put(self, value: Any, mark: Any) -> None:
        if not self._open:
            self.value = value
            return
        top = self._open[-1]
        if isinstance(top.value, list):
            top.value.append(value)
            return
        name, top.name = top.name, None
        if name == _MERGE:
            merged = value if isinstance(value, list) else [value]
            if not all(isinstance(each, dict) for each in merged):
                raise _Wrong("`<<` takes in a mapping or a list of such", mark)
            top.merged += merged
        else:
            top.value[name] = value

    def _count(self, values: int, mark: Any) -> None:
        self._values += values
        if self._values > MOST_VALUES:
            raise _Wrong(f"it has more than {MOST_VALUES} values, aliases written out", mark)

    def _note(self, place: str, mark: Any) -> None:
        if self._lines is not None:
            self._lines.setdefault(place, mark.line + 1)


def _check_tag(event: Any, kinds: tuple[str, ...]) -> str | None:
    """The kind that an explicit tag names, if there is one."""
    tag = event.tag
    if tag is None or tag == "!":
        return "str" if tag and "str" in kinds else None
    if tag not in _TAGS or (kind := tag.removeprefix(_CORE)) not in kinds:
        raise _Wrong(f"the tag {tag} has no meaning here; leave it out", event.start_mark)
    return str(kind)


def _is_of(value: Any, kind: str) -> bool:
    if kind == "null":
        return value is None
    if kind == "bool":
        return isinstance(value, bool)
    number = isinstance(value, int) and not isinstance(value, bool)
    return number or (kind == "float" and isinstance(value, float))


def _built(text: str, lines: dict[str, int] | None = None) -> Any:
    reading = _Reading(lines)
    events: Iterator[Any] = yaml.parse(text, Loader=_PARSER)
    for event in events:
        try:
            reading.read(event)
        except _Wrong as wrong:
            wrong.place = reading.place()
            raise
    return reading.value


@dataclass(frozen=True)
class YamlFile:
    """What a file holds, and where in it that stands."""

    name: str
    text: str = field(repr=False)
    data: Any = field(repr=False)

    def at(self, place: str) -> str:
        """How a sentence about what stands at `place` (`walls[2].from_m`) begins: `FILE line 7: …`.

        What is not there itself is looked for where it is lacking.
        """
        return f"{self.name}{self.line(place)}: {place}" if place else self.name

    def line(self, place: str) -> str:
        """`` line 7``, of the innermost part of `place` that is written in the file."""
        while place and place not in self._lines:
            place = place[: max(place.rfind("."), place.rfind("["), 0)]
        return f" line {self._lines[place]}" if place else ""

    @cached_property
    def _lines(self) -> dict[str, int]:
        lines: dict[str, int] = {}
        _built(self.text, lines)
        return lines

    def __str__(self) -> str:
        return self.name


def line_in(file: str | YamlFile, place: str) -> str:
    """`` line 7`` of a file whose text is at hand, nothing where only its name is."""
    return file.line(place) if isinstance(file, YamlFile) else ""


def read_yaml_file(path: Path, error: type[Exception]) -> YamlFile:
    """A YAML (or JSON) file.

    Raises:
        error: it cannot be read, is neither, or holds what `yaml_reader` refuses; one sentence.
    """
    try:
        if path.is_dir():
            raise error(f"{path} cannot be read: it is a folder, and a file is meant")
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES + 1)
    except (OSError, ValueError) as reason:
        why = getattr(reason, "strerror", None) or str(reason)
        raise error(f"{path} cannot be read: {why}") from None
    if len(data) > LARGEST_BYTES:
        raise error(f"{path} cannot be read: it has more than {LARGEST_BYTES // 1_000_000} MB")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as reason:
        line = data.count(b"\n", 0, reason.start) + 1
        raise error(
            f"{path} cannot be read: it is not UTF-8 text (line {line}); save it as UTF-8"
        ) from None
    return yaml_of_text(text, error, str(path))


def yaml_of_text(text: str, error: type[Exception], name: str) -> YamlFile:
    """A text of YAML (or JSON); `name` is the path of its file.

    Raises:
        error: it is neither, or holds what `yaml_reader` refuses; one sentence.
    """
    kind = "JSON" if name.endswith(".json") else "YAML"
    try:
        return YamlFile(name, text, _built(text))
    except _Wrong as reason:
        place = f"{reason.place}: " if 0 < len(reason.place) < LONGEST_PLACE else ""
        raise error(f"{name} line {reason.mark.line + 1}: {place}{reason.problem}") from None
    except yaml.YAMLError as reason:
        mark, problem = getattr(reason, "problem_mark", None), getattr(reason, "problem", None)
        if mark is None or problem is None:
            told = getattr(reason, "reason", None) or str(reason)
            raise error(f"{name} is not {kind}: {' '.join(str(told).split())}") from None
        where = f"line {mark.line + 1}, column {mark.column + 1}"
        raise error(f"{name} is not {kind}: {where}: {problem}") from None


def read_yaml(path: Path, error: type[Exception]) -> Any:
    """What a YAML (or JSON) file holds; raises as `read_yaml_file` does."""
    return read_yaml_file(path, error).data


def parsed_yaml(text: str, error: type[Exception], name: str) -> Any:
    """What a text of YAML (or JSON) holds; raises as `yaml_of_text` does."""
    return yaml_of_text(text, error, name).data


class _Dumper(yaml.SafeDumper):
    """YAML without anchors, that this reader reads again as it was written."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def _text_node(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    try:
        plain = scalar(text) == text
    except ValueError:
        plain = False
    return dumper.represent_scalar(f"{_CORE}str", text, style=None if plain else '"')


_Dumper.add_representer(str, _text_node)


def written_yaml(value: object) -> str:
    """Builtins as YAML text, lines of a hundred characters."""
    return str(
        yaml.dump(
            value,
            Dumper=_Dumper,
            sort_keys=False,
            allow_unicode=True,
            default_flow_style=None,
            width=100,
        )
    )
