"""`StateStore`: keeps the latest value of every key, by Zenoh timestamp, and what changed when."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Self

from fleet.stores.errors import StoreError
from keyexpr_schema.transport.storage import Journaled, Write


class StateStore(ABC):
    """A durable map from key expression to latest value.

    The meaning is that of zenohd's storage manager: the write with the latest timestamp wins,
    whatever the order of arrival; a deletion is a write and leaves a tombstone; a write with a
    wildcard applies to the keys that exist. Thread-safe. Reads show what is durable and nothing
    else: a value that was read survives the end of the process at any moment.
    """

    def __init__(self, wall_time_s: Callable[[], float] = time.time) -> None:
        self._wall_time_s = wall_time_s

    def apply(self, batch: Sequence[Write]) -> int:
        """Apply `batch` in one transaction; how many of the writes changed something.

        Raises:
            StoreError: nothing of the batch was applied.
        """
        for write in batch:
            if write.stamp <= 0:
                raise StoreError(f"a write to {write.keyexpr!r} carries no timestamp")
        return self._apply(batch, self._wall_time_s()) if batch else 0

    @abstractmethod
    def _apply(self, batch: Sequence[Write], wall_time_s: float) -> int: ...

    def get(self, keyexpr: str) -> Write | None:
        """The value of one key, None when it has none or it was deleted."""
        found = self.select(keyexpr)
        return found[0] if found else None

    @abstractmethod
    def select(self, pattern: str) -> list[Write]:
        """The values of every key that `pattern` (`*`, `**` and `$*` allowed) matches, by key."""

    @abstractmethod
    def journal(self, prefix: str, after: int, limit: int) -> tuple[list[Journaled], int]:
        """At most `limit` changes numbered above `after` of keys under `prefix/`, oldest first.

        Also the number of the newest entry there is, of any key.
        """

    @abstractmethod
    def close(self) -> None:
        """Release everything; what was applied stays."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
