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
"""What carries an object or a robot directly, as finely as is known: a place, a thing that it is on
or in, or a robot or person who has it. `fleet.core.model.derived` says what follows from that."""
ON = "on"
"""What an object lies on. Of a thing it says the same as `at`; `floor`, and a surface that is no
thing of its own, stand beside `at`, which is then a place."""
IN = "in"
"""The thing that an object is in: another reading of `at`."""
HOLDING = "holding"
"""What a robot's hand holds: an object or `nothing`."""
SEARCHED = "searched"
"""Whether somebody has looked around in a place."""
IS_OPEN = "is_open"
"""Whether something that opens is open."""
IS_ON = "is_on"
"""Whether something that is switched is on."""
LOCATED = "located"
"""Derived: whether it is known where an object is."""
HELD = "held"
"""Derived: whether a robot's hand holds an object."""
REACHABLE = "reachable"
"""Derived: whether an object can be seen and taken, because it is in nothing that is closed, and
nothing that is open is in the way."""
CHARGE = "charge"
"""How full a robot's battery is [%], in steps of 5; 0 is empty, and 1 nearly so."""
BLOCKED_BY = "blocked_by"
"""The thing that somebody found in the way of hands at a piece of furniture; it is so while it is
open. What always is (a drawer of the one below) the thing itself says."""


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
