"""Names that robotctl makes up."""

from __future__ import annotations

import uuid
from collections.abc import Iterable

from keyexpr_schema.errors import InvalidId
from keyexpr_schema.ids import slug


def free_name(text: str, taken: Iterable[str], kind: str) -> str:
    """A name made from the words of `text` that is not one of `taken`.

    Where no letter of it can stand in a name, as of Chinese, the name is `kind`.
    """
    used = set(taken)
    try:
        base = slug(text)
    except InvalidId:
        base = kind
    number = 1
    name = base
    while name in used:
        number += 1
        name = f"{base}-{number}"
    return name


def request_name() -> str:
    """A name for one request, never used before."""
    return f"req-{uuid.uuid4().hex[:12]}"
