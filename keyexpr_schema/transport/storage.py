"""What passes between a router and a store. No Zenoh here: stores are tested without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Write:
    """A put or a deletion of one key (realm included), or with wildcards of those that exist.

    `stamp` orders writes; see `wire.stamp_of_text`.
    """

    keyexpr: str
    stamp: int
    deleted: bool
    encoding: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Journaled:
    """A write as it was applied: its number, when (Unix seconds), and what."""

    number: int
    wall_time_s: float
    keyexpr: str
    deleted: bool
    stamp: int
    data: bytes


class Store(Protocol):
    """What the router needs of a store; `fleet.stores.StateStore` says what each promises."""

    def apply(self, batch: Sequence[Write], /) -> int: ...

    def select(self, pattern: str, /) -> list[Write]: ...

    def journal(self, prefix: str, after: int, limit: int, /) -> tuple[list[Journaled], int]: ...
