"""Facts, as every party writes and reads them: keys, relations, values.

A fact is `relation(subject) = value`, in that order everywhere. A value is written as in JSON,
and a word needs no quotes: `true`, `false`; `unknown` (or `null`); a JSON number, `3` a whole one,
`3.0` and `1e3` with a fraction; text in double quotes is that text, `"3"` a word of one digit; and
anything else is a word as it stands (`kitchen`, `007`, `nan`).
"""

from __future__ import annotations

import re
from typing import NamedTuple

import msgspec

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


_LITERAL = re.compile(r"\s*([\w.-]+)\s*(?:\(\s*([\w.-]+)\s*\)\s*=|\s([\w.-]+)\s)\s*(\".*\"|\S+)\s*")


def parse_value(text: str) -> Value:
    """The value that `text` stands for; the rule stands at the head of this module."""
    if text == "unknown":
        return None
    try:
        value = msgspec.json.decode(text)
    except (msgspec.DecodeError, RecursionError):
        return text
    return text if isinstance(value, list | dict) else value


def render_value(value: Value) -> str:
    """A value as it is written: `parse_value` of it gives `value` again."""
    if value is None:
        return "unknown"
    if isinstance(value, str) and parse_value(value) == value and value == value.strip():
        return value
    return msgspec.json.encode(value).decode()


def parse_literal(text: str) -> Literal | None:
    """`at(cup_1) = kitchen` or `at cup_1 kitchen`; `None` if it is neither."""
    found = _LITERAL.fullmatch(text)
    if found is None:
        return None
    relation, called, listed, value = found.groups()
    return Literal(FactKey(relation, called or listed), parse_value(value))
