"""`Table`: a persistent mapping in order of insertion. A changed copy costs O(log n).

Hashed tries know no order, and the hashes of strings differ from process to process; whatever
walked one would not replay. So every entry carries the number of its insertion.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Generic, TypeVar, get_args, get_origin, overload

import immutables
import msgspec

K = TypeVar("K")
V = TypeVar("V")
T = TypeVar("T")


class Table(Mapping[K, V], Generic[K, V]):
    """An immutable mapping; `set` and `without` give changed copies.

    As in a `dict`, a value that is set again keeps its place, and one that was taken out goes to
    the end. Looking up costs O(log n), walking through all O(n log n).
    """

    __slots__ = ("_entries", "_next")

    def __init__(self, entries: Mapping[K, V] = {}) -> None:
        numbered = {key: (number, value) for number, (key, value) in enumerate(entries.items())}
        self._entries: immutables.Map[K, tuple[int, V]] = immutables.Map(numbered)
        self._next = len(numbered)

    @classmethod
    def _of(cls, entries: immutables.Map[K, tuple[int, V]], number: int) -> Table[K, V]:
        made: Table[K, V] = cls.__new__(cls)
        made._entries, made._next = entries, number
        return made

    def __getitem__(self, key: K) -> V:
        return self._entries[key][1]

    @overload
    def get(self, key: K, /) -> V | None: ...
    @overload
    def get(self, key: K, default: V | T, /) -> V | T: ...
    def get(self, key: K, default: Any = None, /) -> Any:
        """The value of `key`, or `default`."""
        entry = self._entries.get(key)
        return default if entry is None else entry[1]

    def __contains__(self, key: object) -> bool:
        return key in self._entries

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[K]:
        return (key for key, _ in sorted(self._entries.items(), key=_number))

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Table) and self._entries is other._entries:
            return True
        return super().__eq__(other)

    def __repr__(self) -> str:
        return f"Table({dict(self)!r})"

    def set(self, key: K, value: V) -> Table[K, V]:
        """A copy with one entry set."""
        known = self._entries.get(key)
        if known is not None:
            if known[1] is value:
                return self
            return self._of(self._entries.set(key, (known[0], value)), self._next)
        return self._of(self._entries.set(key, (self._next, value)), self._next + 1)

    def without(self, key: K) -> Table[K, V]:
        """A copy with one entry left out; the table itself if it has none."""
        if key not in self._entries:
            return self
        return self._of(self._entries.delete(key), self._next)

    def updated(self, changes: Mapping[K, V]) -> Table[K, V]:
        """A copy with these entries set."""
        number = self._next
        entries = self._entries.mutate()
        for key, value in changes.items():
            known = entries.get(key)
            if known is None:
                entries[key] = number, value
                number += 1
            else:
                entries[key] = known[0], value
        return self._of(entries.finish(), number)


def _number(entry: tuple[Any, tuple[int, Any]]) -> int:
    return entry[1][0]


def encode_table(value: Any) -> Any:
    """What msgspec writes for a table: its `enc_hook`.

    Raises:
        NotImplementedError: it is none.
    """
    if isinstance(value, Table):
        return dict(value)
    raise NotImplementedError(f"{type(value).__name__} cannot be written")


def decode_table(kind: Any, value: Any) -> Any:
    """The table that msgspec has read the entries of: its `dec_hook`.

    Raises:
        NotImplementedError: something else is wanted.
    """
    if get_origin(kind) is Table:
        return Table(msgspec.convert(value, dict[get_args(kind)], dec_hook=decode_table))  # type: ignore[misc]
    raise NotImplementedError(f"{kind} cannot be read")
