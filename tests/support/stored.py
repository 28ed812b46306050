"""What a store holds, without when it received that."""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from keyexpr_schema.transport.store.storage import Write


def as_written(writes: Iterable[Write | None]) -> list[Write | None]:
    """The writes as they were applied."""
    return [None if write is None else replace(write, received=0) for write in writes]
