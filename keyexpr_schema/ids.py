"""Names that may stand as one chunk of a key expression."""

from __future__ import annotations

import re
from typing import Annotated

import msgspec

from keyexpr_schema.errors import InvalidId

ID_RULE = "1 to 63 ASCII letters, digits, '_', '.' or '-', starting with a letter or a digit"
ID_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,62}$"
_ID = re.compile(ID_PATTERN, re.ASCII)

Id = Annotated[str, msgspec.Meta(pattern=ID_PATTERN)]
"""1 to 63 ASCII letters, digits, `_`, `.`, `-`; the first a letter or a digit.

That leaves out everything with a meaning to Zenoh (`/ * $ ? # @`), empty chunks and anything
whose bytes depend on Unicode normalisation, so an id is always one canonical chunk.
"""

ACTOR_PREFIX = "?"
"""Marks a task argument that names an actor (`?a1`) and not a thing; no id starts with it."""


def check_id(value: str, what: str = "name") -> str:
    """Return `value` if it is a valid id.

    Raises:
        InvalidId: it is not; the message says what would be.
    """
    if not _ID.fullmatch(value):
        raise InvalidId(f"{what} {value!r} is not valid: use {ID_RULE}")
    return value


def slug(text: str, limit: int = 40) -> str:
    """Turn free text into an id: `"Bring the cup!"` becomes `"bring-the-cup"`.

    Raises:
        InvalidId: nothing of the text can stand in an id.
    """
    words = re.sub(r"[^a-z0-9_]+", "-", text.lower()).strip("-_")[:limit].rstrip("-_")
    return check_id(words, "text")
