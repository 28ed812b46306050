"""The writes of a store in memory, found by key, by wildcards, and by the order of change."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Iterator, Sequence
from heapq import merge
from operator import itemgetter
from typing import Any

from keyexpr_schema.transport.store.patterns import Patterns
from keyexpr_schema.transport.store.storage import Write

_DEPTH = 4
"""Chunks that lead to a bucket: the realm, and what tells one kind of key from another."""
_WORTH_TIDYING = 1000
_FEW = 100
"""Changes that are gone through at once: to count what a pattern may match takes as long."""
MAX_BYTES = 1_000_000
"""Of values in one answer: beyond, a query would hold all others up."""

Numbered = tuple[int, Write]


class _Changes:
    """The newest changes of some keys: by key, and in the order of their numbers."""

    def __init__(self) -> None:
        self._of: dict[str, Numbered] = {}
        self._numbers: list[int] = []
        self._keys: list[str] = []

    def __len__(self) -> int:
        return len(self._of)

    @property
    def in_order(self) -> int:
        """Changes held in order, with those replaced since that were not tidied away yet."""
        return len(self._numbers)

    def get(self, keyexpr: str) -> Numbered | None:
        return self._of.get(keyexpr)

    def set(self, number: int, write: Write) -> bool:
        """Keep the newest change of all; whether it is of a key that was not here."""
        fresh = write.keyexpr not in self._of
        self._of[write.keyexpr] = (number, write)
        self._numbers.append(number)
        self._keys.append(write.keyexpr)
        self._tidy()
        return fresh

    def drop(self, keyexpr: str) -> bool:
        """Whether the key was here."""
        there = self._of.pop(keyexpr, None) is not None
        if there:
            self._tidy()
        return there

    def count_after(self, number: int) -> int:
        """How many changes `after` would look at."""
        return len(self._numbers) - bisect_right(self._numbers, number)

    def after(self, number: int) -> Iterator[Numbered]:
        """The changes above a number, in order."""
        for at in range(bisect_right(self._numbers, number), len(self._numbers)):
            found = self._of.get(self._keys[at])
            if found is not None and found[0] == self._numbers[at]:
                yield found

    def _tidy(self) -> None:
        """Drop what later changes of the same keys have replaced."""
        if len(self._numbers) <= 2 * len(self._of) + _WORTH_TIDYING:
            return
        kept = list(self.after(0))
        self._numbers = [number for number, _ in kept]
        self._keys = [write.keyexpr for _, write in kept]


class Index:
    """The newest write of every key, deletions included; values in buckets by the first chunks.

    A pattern looks only into the buckets of keys that it can match, so that the orders of all
    robots are found without a look at their reports, and at no key that is deleted. `last` is the
    number of the newest change.
    """

    def __init__(self, last: int = 0) -> None:
        self._values, self._tombstones = _Changes(), _Changes()
        self._root: dict[str, Any] = {}
        self.last = last

    def __len__(self) -> int:
        return len(self._values) + len(self._tombstones)

    @property
    def remembered(self) -> int:
        """Changes held in order, with those replaced since that were not tidied away yet."""
        return self._values.in_order + self._tombstones.in_order

    @property
    def tombstones(self) -> int:
        """How many deletions are remembered."""
        return len(self._tombstones)

    def _find(self, keyexpr: str) -> Numbered | None:
        return self._values.get(keyexpr) or self._tombstones.get(keyexpr)

    def get(self, keyexpr: str) -> Write | None:
        """The newest write of a key: its value, or its tombstone."""
        found = self._find(keyexpr)
        return found[1] if found is not None else None

    def number(self, keyexpr: str) -> int:
        """The number of the newest change of a key; 0: there is none."""
        found = self._find(keyexpr)
        return found[0] if found is not None else 0

    def set(self, number: int, write: Write) -> None:
        """Keep `write`, the newest change of all, as that of its key."""
        self.last = max(self.last, number)
        if write.deleted:
            self._drop_value(write.keyexpr)
            self._tombstones.set(number, write)
            return
        self._tombstones.drop(write.keyexpr)
        if self._values.set(number, write):
            node = self._root
            for chunk in _path(write.keyexpr):
                node = node.setdefault(chunk, {})
            node[write.keyexpr] = None

    def forget(self, keyexpr: str) -> None:
        """Know nothing of a key any more."""
        if not self._tombstones.drop(keyexpr):
            self._drop_value(keyexpr)

    def _drop_value(self, keyexpr: str) -> None:
        if not self._values.drop(keyexpr):
            return
        path = _path(keyexpr)
        nodes = [self._root]
        for chunk in path:
            nodes.append(nodes[-1][chunk])
        del nodes[-1][keyexpr]
        for node, chunk in zip(nodes[-2::-1], reversed(path), strict=True):
            if node[chunk]:
                break
            del node[chunk]

    def matching(self, pattern: str) -> list[Write]:
        """The values of every key that `pattern` matches, in order of key."""
        if "*" not in pattern:
            found = self._values.get(pattern)
            return [found[1]] if found is not None else []
        entries = [(write.keyexpr, write) for _, write in self._found(Patterns([pattern]))]
        return [write for _, write in sorted(entries, key=itemgetter(0))]

    def since(
        self, patterns: Sequence[str], after: int, limit: int, ignored: int
    ) -> tuple[list[Numbered], bool]:
        """The newest writes numbered above `after` of keys that one of `patterns` matches.

        In order of number, deletions above `ignored` included; at most `limit` of them and not
        much above `MAX_BYTES`, and whether that cut something off.
        """
        taken: list[Numbered] = []
        size = 0
        asked = Patterns(patterns)
        deleted = self._tombstones.after(max(after, ignored))
        gone = (change for change in deleted if asked.matches(change[1].keyexpr))
        for number, write in merge(self._newer(asked, after), gone, key=itemgetter(0)):
            if len(taken) >= limit or size > MAX_BYTES:
                return taken, True
            taken.append((number, write))
            size += len(write.data) + len(write.keyexpr)
        return taken, False

    def _newer(self, asked: Patterns, after: int) -> Iterator[Numbered]:
        """Values; goes through the changes or through what may match, whichever are fewer."""
        changed = self._values.count_after(after)
        if changed <= _FEW or changed <= 2 * self._within(asked):
            return (c for c in self._values.after(after) if asked.matches(c[1].keyexpr))
        found = (change for change in self._found(asked) if change[0] > after)
        return iter(sorted(found, key=itemgetter(0)))

    def _within(self, asked: Patterns) -> int:
        """How many values a look at all that may match would look at."""
        return len(asked.keys) + sum(map(len, self._all_buckets(asked.wild)))

    def _found(self, asked: Patterns) -> Iterator[Numbered]:
        """The values, each once."""
        keys, matches = asked.keys, asked.matches
        yield from filter(None, map(self._values.get, keys))
        for bucket in self._all_buckets(asked.wild):
            for keyexpr in bucket:
                if keyexpr not in keys and matches(keyexpr):
                    found = self._values.get(keyexpr)
                    assert found is not None
                    yield found

    def _all_buckets(self, patterns: Sequence[str]) -> Collection[dict[str, None]]:
        return {id(b): b for pattern in patterns for b in self._buckets(pattern)}.values()

    def _buckets(self, pattern: str) -> list[dict[str, None]]:
        chunks = pattern.split("/")
        nodes = [self._root]
        for depth in range(_DEPTH):
            chunk = chunks[depth] if depth < len(chunks) else ""
            if chunk == "**":
                chunks[depth + 1 :] = ["**"] * _DEPTH  # anything may follow
            if "*" in chunk:
                nodes = [child for node in nodes for child in node.values()]
            else:
                nodes = [node[chunk] for node in nodes if chunk in node]
        return nodes


def _path(keyexpr: str) -> list[str]:
    """The first chunks of a key, filled up; every key has the same number of them."""
    chunks = keyexpr.split("/", _DEPTH)[:_DEPTH]
    return chunks + [""] * (_DEPTH - len(chunks))
