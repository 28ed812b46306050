"""JSON to payloads, from any thread.

msgspec builds what it knows of a type when it first decodes one, and marks the type as known before
it is done: a second thread that decodes the same type, or one that has it as a field, at that
moment reads half of it and the process dies (a segmentation fault with msgspec 0.22).
So decoders are made one at a time, whole, and kept.
"""

from __future__ import annotations

import threading
from typing import Any, TypeVar

import msgspec

T = TypeVar("T")

LARGEST_INTEGER = 2**63 - 1
"""What is larger is no number that can be meant, and no snapshot could keep it."""

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
