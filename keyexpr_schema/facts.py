"""Facts, as every party writes and reads them: keys, relations, values.

A fact is `relation(subject) = value`, in that order everywhere. A value is written as in JSON,
and a word needs no quotes: `true`, `false`; `unknown` (or `null`); a JSON number, `3` a whole one,
`3.0` and `1e3` with a fraction; text in double quotes is that text, `"3"` a word of one digit; and
anything else is a word as it stands (`kitchen`, `007`, `nan`, a number that no payload can hold).
"""

from __future__ import annotations

import json
import math
import re
from typing import NamedTuple

Value = str | bool | int | float | None
"""The value of a fact. `None` is *unknown*: somebody says that nobody knows."""

NOTHING = "nothing"
"""The value of `holding` for an empty hand."""

AT = "at"
"""Where an object or a robot is: a place; for what a robot has in hand or basket, that robot."""
ON = "on"
"""The surface, or `floor`, that an object lies on."""
HOLDING = "holding"
"""What a robot's hand holds: an object or `nothing`."""
SEARCHED = "searched"
"""Whether somebody has looked around in a place."""
LOCATED = "located"
"""Derived, in goals only: whether it is known where an object is."""
HELD = "held"
"""Derived, in goals only: whether a hand holds an object."""


class FactKey(NamedTuple):
    """One state variable, written `relation(subject)`.

    In ground actions of a plan the subject may be an actor (`?a1`).
    """

    relation: str
    subject: str

    def __str__(self) -> str:
        return f"{self.relation}({self.subject})"


class Literal(NamedTuple):
    """`variable = value`: what an action needs or makes true, or what a sentence says."""

    variable: FactKey
    value: Value

    def __str__(self) -> str:
        return f"{self.variable} = {render_value(self.value)}"


WHOLE_BELOW = 2.0**63
"""Whole numbers that a payload can hold."""
_NUMBER = re.compile(r"-?(?:0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?")
_WORDS: dict[str, Value] = {"unknown": None, "null": None, "true": True, "false": False}
_LITERAL = re.compile(r"\s*([\w.-]+)\s*(?:\(\s*([\w.-]+)\s*\)\s*=|\s([\w.-]+)\s)\s*(\".*\"|\S+)\s*")


def parse_value(text: str) -> Value:
    """The value that `text` stands for; the rule stands at the head of this module."""
    if text in _WORDS:
        return _WORDS[text]
    if number := _NUMBER.fullmatch(text):
        real = float(text)
        if number[1] is not None or number[2] is not None:
            return real if math.isfinite(real) else text
        return int(text) if abs(real) < WHOLE_BELOW else text
    if text.startswith('"'):
        try:
            word = json.loads(text)
        except ValueError:
            return text
        return word if isinstance(word, str) else text
    return text


def render_value(value: Value) -> str:
    """A value as it is written: `parse_value` of it gives `value` again."""
    if value is None:
        return "unknown"
    if isinstance(value, str):
        plain = parse_value(value) == value and value == value.strip()
        return value if plain else json.dumps(value, ensure_ascii=False)
    return json.dumps(value)


def parse_literal(text: str) -> Literal | None:
    """`at(cup_1) = kitchen` or `at cup_1 kitchen`; `None` if it is neither."""
    found = _LITERAL.fullmatch(text)
    if found is None:
        return None
    relation, called, listed, value = found.groups()
    return Literal(FactKey(relation, called or listed), parse_value(value))
