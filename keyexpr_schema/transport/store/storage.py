"""What passes between a router and a store. No Zenoh here: stores are tested without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import msgspec

from keyexpr_schema.errors import ForeignKey
from keyexpr_schema.key import Delivery, Key
from keyexpr_schema.key_lookup import key_of
from keyexpr_schema.keyspace import KEY_TREES

UNJOURNALED = "sim/"
"""What a simulation puts is not in a journal: it would be most of it, and none of it is news."""


class Write(msgspec.Struct, frozen=True, gc=False):
    """A put or a deletion of one key (realm included), or with wildcards of those that exist.

    `stamp` orders writes; see `stamps.stamp_of_text`. `late_us`: how long its writer has held it
    back [µs]. `received`: when the store received it, less that [µs], by its own count; it says so.
    `by`: the common name of who has signed it, as long as it is not applied.
    """

    keyexpr: str
    stamp: int
    deleted: bool
    encoding: str
    data: bytes
    late_us: int = 0
    received: int = 0
    by: str = ""


@dataclass(frozen=True, slots=True)
class AppliedWrite:
    """A write in a store's journal: its number, when it was applied (Unix seconds), and what."""

    number: int
    wall_time_s: float
    keyexpr: str
    deleted: bool
    stamp: int
    data: bytes


@dataclass(frozen=True, slots=True)
class JournalQuery:
    """Entries numbered above `after`, of keys that `pattern` (without realm) matches.

    Those applied at `since_s` [s, Unix] or later, at most `limit` of them; the first, or with
    `newest` the last.
    """

    after: int = 0
    limit: int = 1000
    pattern: str = "**"
    since_s: float | None = None
    newest: bool = False


@dataclass(frozen=True, slots=True)
class Changes:
    """The newest write of every key that changed since a position, in the order of change.

    `position`: where they end; to be given back as it is. `whole`: they begin with an empty store,
    because the position says nothing of this one; what is in none of them up to the end is gone.
    `more`: not all of them yet.
    """

    writes: list[Write]
    position: str
    whole: bool
    more: bool


class Store(Protocol):
    """A durable map from key expression to latest value, and a journal of what changed when.

    The meaning is that of zenohd's storage manager: the write with the latest timestamp wins,
    whatever the order of arrival; a deletion is a write and leaves a tombstone for a while; a write
    with a wildcard applies to the keys that exist. Beyond that, keys that go by receipt have what
    was received last, be it stamped by a clock that is behind. Thread-safe. A value that was read
    survives the end of the process at any moment, and once `sync` has returned a power cut, too.
    """

    def apply(self, batch: Sequence[Write], /) -> int:
        """Apply `batch` in one transaction; how many of the writes changed something."""

    def sync(self) -> None:
        """Return when all that was applied before is on the disk."""

    def select(self, pattern: str, /) -> list[Write]:
        """The values of every key that `pattern` (`*`, `**` and `$*` allowed) matches, by key."""

    def receipt(self) -> int:
        """The receipt that something would have that comes now [µs]."""

    def newest(self, keyexprs: Sequence[str], /) -> list[Write | None]:
        """The newest write of each of these keys, be it a deletion; None where there is none."""

    def changes(self, patterns: Sequence[str], position: str, limit: int, /) -> Changes:
        """At most `limit` changes since `position` of keys that one of `patterns` matches.

        `position` "": from the beginning, which lists what is there now.
        """

    def journal(self, realm: str, asked: JournalQuery, /) -> tuple[list[AppliedWrite], int]:
        """What is asked for of the journal of the keys of `realm`, oldest first.

        Also the number of the newest entry there is, of any key.
        """


def is_stored(keyexpr: str) -> bool:
    """Whether a key expression, realm included, is one key that the store keeps."""
    key = _key_of(keyexpr)
    return key is not None and key.stored


def deletes_tree(keyexpr: str) -> bool:
    """Whether a deletion of this, realm included, is one of the few with wildcards that count.

    What the planner deletes when something is over is about one thing that it names. Anything wider
    (`**`, `goals/*/spec`) would empty the store by one message, which access control cannot tell
    from the rule that lets somebody delete one such key.
    """
    realm, _, rest = keyexpr.partition("/")
    return "*" not in realm and any(tree.is_of_one(rest) for tree in KEY_TREES)


@lru_cache(maxsize=8192)
def tree_over(keyexpr: str) -> str:
    """The deletion with wildcards that concerns a key, realm included; empty: there is none."""
    key = _key_of(keyexpr)
    realm, _, rest = keyexpr.partition("/")
    for tree in KEY_TREES:
        if key is not None and key in tree.keys and "*" in tree.template:
            return f"{realm}/{tree.of(key.parse(rest))}"
    return ""


def is_by_receipt(keyexpr: str) -> bool:
    """Whether of a key, realm included, what was received last holds."""
    key = _key_of(keyexpr)
    return key is not None and key.by_receipt


def is_journaled(keyexpr: str) -> bool:
    """Whether changes of this key, realm included, are in the journal.

    Not those of a simulation, and not those of which only the latest matters (the state that each
    robot puts every second would push all else out).
    """
    key = _key_of(keyexpr)
    return key is None or (
        key.delivery is Delivery.STORED and not key.template.startswith(UNJOURNALED)
    )


def stored_key(keyexpr: str) -> Key[Any, Any] | None:
    """The row of the table that a key, realm included, belongs to; None: to none, or wildcards."""
    return _key_of(keyexpr)


@lru_cache(maxsize=8192)
def _key_of(keyexpr: str) -> Key[Any, Any] | None:
    realm, _, rest = keyexpr.partition("/")
    try:
        return None if "*" in realm else key_of(rest)
    except ForeignKey:
        return None
