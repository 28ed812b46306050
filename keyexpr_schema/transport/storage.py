"""What passes between a router and a store. No Zenoh here: stores are tested without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Write:
    """A put or a deletion of one key (realm included), or with wildcards of those that exist.

    `stamp` orders writes; see `samples.stamp_of_text`.
    """

    keyexpr: str
    stamp: int
    deleted: bool
    encoding: str
    data: bytes


@dataclass(frozen=True, slots=True)
class AppliedWrite:
    """A write in a store's journal: its number, when it was applied (Unix seconds), and what."""

    number: int
    wall_time_s: float
    keyexpr: str
    deleted: bool
    stamp: int
    data: bytes


class Store(Protocol):
    """A durable map from key expression to latest value, and a journal of what changed when.

    The meaning is that of zenohd's storage manager: the write with the latest timestamp wins,
    whatever the order of arrival; a deletion is a write and leaves a tombstone; a write with a
    wildcard applies to the keys that exist. Thread-safe. Reads show what is durable and nothing
    else: a value that was read survives the end of the process at any moment.
    """

    def apply(self, batch: Sequence[Write], /) -> int:
        """Apply `batch` in one transaction; how many of the writes changed something."""

    def select(self, pattern: str, /) -> list[Write]:
        """The values of every key that `pattern` (`*`, `**` and `$*` allowed) matches, by key."""

    def journal(self, prefix: str, after: int, limit: int, /) -> tuple[list[AppliedWrite], int]:
        """At most `limit` changes numbered above `after` of keys under `prefix/`, oldest first.

        Also the number of the newest entry there is, of any key.
        """
