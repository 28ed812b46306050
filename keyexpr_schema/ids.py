"""Names that may stand as one chunk of a key expression."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from typing import Annotated

import msgspec

from keyexpr_schema.errors import InvalidId
from keyexpr_schema.facts import NOTHING

ID_RULE = "1 to 63 ASCII letters, digits, '_', '.' or '-', starting with a letter or a digit"
ID_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,62}$"
_ID = re.compile(ID_PATTERN, re.ASCII)

Id = Annotated[str, msgspec.Meta(pattern=ID_PATTERN)]
"""1 to 63 ASCII letters, digits, `_`, `.`, `-`; the first a letter or a digit.

That leaves out everything with a meaning to Zenoh (`/ * $ ? # @`), empty chunks and anything
whose bytes depend on Unicode normalisation, so an id is always one canonical chunk.
"""

VALUE_WORDS = frozenset({"true", "false", "null", "unknown", NOTHING})
"""What no thing is called, in whatever case."""
_NUMBER = re.compile(r"[0-9][0-9_.]*(?:[eE][-+]?[0-9]+)?|0[xob][0-9a-fA-F]+")

_ACTOR_MARK = "?"
"""Marks a task's argument that names an actor and not a thing; no id starts with it."""


def check_id(value: str, what: str = "name") -> str:
    """Return `value` if it is a valid id.

    Raises:
        InvalidId: it is not; the message says what would be.
    """
    if not _ID.fullmatch(value):
        raise InvalidId(f"{what} {value!r} is not valid: use {ID_RULE}")
    return value


def check_name(value: str, what: str = "name") -> str:
    """Return `value` if a thing may have it as its name: an id that is no value besides.

    Places, objects and robots are named in values (`at(cup_1) = kitchen`): a name that reads as a
    number, a truth value, *unknown* or `nothing` would be that wherever it is typed.

    Raises:
        InvalidId: it may not; the message says what would be right.
    """
    check_id(value, what)
    if value.casefold() in VALUE_WORDS:
        raise InvalidId(f"{what} {value!r} is a value and no name; use another, such as x_{value}")
    if _NUMBER.fullmatch(value):
        raise InvalidId(f"{what} {value!r} is a number; use one with a letter, such as no_{value}")
    return value


def is_name(value: str) -> bool:
    """Whether a thing may be called so, see `check_name`."""
    try:
        check_name(value)
    except InvalidId:
        return False
    return True


def actor_arg(actor: str) -> str:
    """How a task's arguments name an actor: `?a1` for `a1`."""
    return _ACTOR_MARK + actor


def actor_in(arg: object) -> str | None:
    """The actor that an argument (or a fact's value) names: `a1` for `?a1`; else `None`."""
    named = isinstance(arg, str) and arg.startswith(_ACTOR_MARK)
    return str(arg)[len(_ACTOR_MARK) :] if named else None


def bare_name(arg: str) -> str:
    """The actor or the thing that an argument names, without saying which: `a1` for `?a1`."""
    return arg.removeprefix(_ACTOR_MARK)


def bound(arg: str, allocation: Mapping[str, str]) -> str:
    """The argument with the actor that it names, if any, replaced by its robot.

    Raises:
        KeyError: the actor has no robot.
    """
    return allocation[arg[len(_ACTOR_MARK) :]] if arg.startswith(_ACTOR_MARK) else arg


def natural_order(name: str) -> tuple[tuple[int, str], ...]:
    """A sort key that puts `t2` before `t10`."""
    parts = enumerate(re.split(r"([0-9]+)", name))  # every second one is a number
    return tuple((int(part), "") if at % 2 else (0, part) for at, part in parts)


def slug(text: str, limit: int = 40) -> str:
    """Turn free text into an id: `"Bring the cup!"` becomes `"bring-the-cup"`.

    Raises:
        InvalidId: nothing of the text can stand in an id.
    """
    plain = "".join(c for c in unicodedata.normalize("NFKD", text) if not unicodedata.combining(c))
    words = re.sub(r"[^a-z0-9_]+", "-", plain.lower()).strip("-_")[:limit].rstrip("-_")
    return check_id(words, "text")
