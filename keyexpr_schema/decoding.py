"""JSON to payloads, from any thread.

msgspec builds what it knows of a type when it first decodes one, and marks the type as known before
it is done: a second thread that decodes the same type, or one that has it as a field, at that
moment reads half of it and the process dies (a segmentation fault with msgspec 0.22).
So decoders are made one at a time, whole, and kept.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable
from itertools import chain
from typing import Any, TypeVar

import msgspec

T = TypeVar("T")

LARGEST_INTEGER = 2**63 - 1
"""What is larger is no number that can be meant, and no snapshot could keep it."""

LARGEST_FRACTION = 1e11
"""So for numbers with a fraction, which are metres, kilograms and seconds: a time that is later is
in the year 5138, and no calendar has it."""

_MAKING = threading.Lock()
_DECODERS: dict[Any, msgspec.json.Decoder[Any]] = {}


def decode(data: bytes | str, kind: type[T]) -> T:
    """The value of that type in JSON.

    Raises:
        msgspec.DecodeError: it is no JSON, or (`msgspec.ValidationError`) not of that type.
    """
    decoder = _DECODERS.get(kind)
    if decoder is None:
        with _MAKING:
            decoder = _DECODERS.setdefault(kind, msgspec.json.Decoder(kind))
    value: T = decoder.decode(data)
    return value


def too_large(value: Any) -> int | float | None:
    """A number somewhere in a decoded value that is larger than any that can be meant."""
    match value:
        case bool() | str():
            return None
        case int():
            return value if abs(value) > LARGEST_INTEGER else None
        case float():
            return value if abs(value) > LARGEST_FRACTION else None
        case msgspec.Struct():
            inner: Iterable[Any] = (getattr(value, name) for name in value.__struct_fields__)
        case dict():
            inner = chain(value, value.values())
        case list() | tuple():
            inner = value
        case _:
            return None
    return next((found for each in inner if (found := too_large(each)) is not None), None)
