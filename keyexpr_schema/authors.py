"""Who a value says that it is from: the fields of payloads that are marked for it.

Which keys are signed (see `transport.signatures`) follows from these marks and the table: those of
which more than one kind of writers, or several of a kind, give values in which such a field is.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args

import msgspec

from keyexpr_schema.key import Component, Delivery, Key

_AUTHOR, _SOURCE = {"names": "author"}, {"names": "source"}

Author = Annotated[str, msgspec.Meta(extra=_AUTHOR)]
"""The person who says it, such as `ana@lab`; with certificates, of `operator.ana`: `ana`."""
Source = Annotated[str, msgspec.Meta(extra=_SOURCE)]
"""Who says so: a robot, `person`, or the planner, which says what it concludes it from."""


class Names(NamedTuple):
    """All that a value says of who it is from."""

    authors: frozenset[str]
    sources: frozenset[str]


def names_in(value: Any) -> Names:
    """Who a payload, and what is in it, says that it is from; who is not said is not named."""
    named: dict[str, set[str]] = {"author": set(), "source": set()}
    for mark, name in _named(value):
        named[mark].add(name)
    return Names(frozenset(named["author"] - {""}), frozenset(named["source"] - {""}))


def _named(value: Any) -> Iterator[tuple[str, str]]:
    match value:
        case msgspec.Struct():
            marks = _marks(type(value))
            for name in value.__struct_fields__:
                if name in marks:
                    yield marks[name], getattr(value, name)
                else:
                    yield from _named(getattr(value, name))
        case dict():
            for inner in value.values():
                yield from _named(inner)
        case list() | tuple():
            for inner in value:
                yield from _named(inner)


@cache
def _marks(kind: type[msgspec.Struct]) -> dict[str, str]:
    """The marked fields of a struct."""
    found = {}
    for field in msgspec.structs.fields(kind):
        for each in getattr(field.type, "__metadata__", ()):
            if isinstance(each, msgspec.Meta) and each.extra in (_AUTHOR, _SOURCE):
                found[field.name] = str(each.extra["names"])
    return found


def structs_in(kind: Any, found: list[type[msgspec.Struct]] | None = None) -> list[Any]:
    """A struct and those inside it, each once, the outer ones first."""
    found = [] if found is None else found
    struct = isinstance(kind, type) and issubclass(kind, msgspec.Struct)
    if struct and kind not in found and kind.__struct_fields__:
        found.append(kind)
        for field in msgspec.structs.fields(kind):
            structs_in(field.type, found)
    for inner in get_args(kind):
        structs_in(inner, found)
    return found


@cache
def is_signed(key: Key[Any, Any]) -> bool:
    """Whether who writes this key has to sign it, where there are certificates.

    Of what the planner alone may write access control knows who it is from; whom it names besides
    is whom it has read of. What passes in questions is not signed.
    """
    kept = key.delivery in (Delivery.STORED, Delivery.LATEST)
    return kept and key.writers != Component.PLANNER and any(map(_marks, structs_in(key.payload)))
