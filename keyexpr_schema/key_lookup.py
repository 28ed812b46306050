"""Which row of the key-space a key expression belongs to."""

from __future__ import annotations

from typing import Any

from keyexpr_schema.errors import ForeignKey
from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import KEYSPACE


def shape(template: str) -> tuple[str, int]:
    """First chunk and length of a template, of the patterns and of the keys that are made of it."""
    return template.partition("/")[0], template.count("/")


_BY_SHAPE = {
    each: tuple(key for key in KEYSPACE if shape(key.template) == each)
    for each in {shape(key.template) for key in KEYSPACE}
}
"""Keys by first chunk and length, so that `key_of` tries few of them."""


def key_of(keyexpr: str) -> Key[Any, Any]:
    """The row of the table that a key expression without wildcards belongs to.

    Raises:
        ForeignKey: it belongs to none.
    """
    for key in _BY_SHAPE.get(shape(keyexpr), ()):
        try:
            key.parse(keyexpr)
        except ForeignKey:
            continue
        return key
    raise ForeignKey(f"{keyexpr!r} is not a key of this system; docs/keyspace.md lists them")
