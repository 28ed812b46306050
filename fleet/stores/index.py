"""The writes of a store in memory, found by key, by wildcards, and by the order of change."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

from keyexpr_schema.transport.store.storage import Write

_DEPTH = 4
"""Chunks that lead to a bucket: the realm, and what tells one kind of key from another."""
_WORTH_TIDYING = 1000
MAX_BYTES = 1_000_000
"""Of values in one answer: beyond, a query would hold all others up."""

Numbered = tuple[int, Write]


@lru_cache(maxsize=1024)
def matcher(*patterns: str) -> re.Pattern[str]:
    """A regular expression for Zenoh key expressions: `*` one chunk, `**` any number of them.

    `$*` is any part of a chunk. As in Zenoh, wildcards do not match chunks that begin with `@`.
    https://github.com/eclipse-zenoh/roadmap/blob/main/rfcs/ALL/Key%20Expressions.md
    """
    some = r"(?!@)[^/]+"
    anything = rf"(?:/{some})*"
    wholes = []
    for pattern in patterns:
        parts: list[str] = []
        for chunk in pattern.split("/"):
            if chunk == "**" and parts and parts[-1] == anything:
                continue
            if chunk == "**":
                parts.append(anything)
            elif chunk == "*":
                parts.append(f"/{some}")
            else:
                text = "[^/]*".join(re.escape(part) for part in chunk.split("$*"))
                parts.append(f"/{'(?!@)' if chunk.startswith('$*') else ''}{text}")
        wholes.append("".join(parts))
    return re.compile("|".join(wholes))


class Index:
    """The newest write of every key, deletions included, in buckets by the first chunks.

    A pattern looks only into the buckets of keys that it can match, so that the orders of all
    robots are found without a look at their reports. `last` is the number of the newest change.
    """

    def __init__(self, last: int = 0) -> None:
        self._entries: dict[str, Numbered] = {}
        self._root: dict[str, Any] = {}
        self._numbers: list[int] = []
        self._keys: list[str] = []
        self.last = last

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def remembered(self) -> int:
        """Changes held in order, with those replaced since that were not tidied away yet."""
        return len(self._numbers)

    def get(self, keyexpr: str) -> Write | None:
        """The newest write of a key: its value, or its tombstone."""
        found = self._entries.get(keyexpr)
        return found[1] if found is not None else None

    def number(self, keyexpr: str) -> int:
        """The number of the newest change of a key; 0: there is none."""
        return self._entries[keyexpr][0] if keyexpr in self._entries else 0

    def set(self, number: int, write: Write) -> None:
        """Keep `write`, the change of that number, as the newest of its key."""
        keyexpr = write.keyexpr
        if keyexpr not in self._entries:
            node = self._root
            for chunk in _path(keyexpr):
                node = node.setdefault(chunk, {})
            node[keyexpr] = None
        self._entries[keyexpr] = (number, write)
        self._numbers.append(number)
        self._keys.append(keyexpr)
        self.last = max(self.last, number)
        if len(self._numbers) > 2 * len(self._entries) + _WORTH_TIDYING:
            self._tidy()

    def forget(self, keyexpr: str) -> None:
        """Know nothing of a key any more."""
        if self._entries.pop(keyexpr, None) is None:
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
            found = self.get(pattern)
            return [found] if found is not None and not found.deleted else []
        fits = matcher(pattern).fullmatch
        keys = (k for bucket in self._buckets(pattern) for k in bucket if fits("/" + k))
        return [write for key in sorted(keys) if not (write := self._entries[key][1]).deleted]

    def since(
        self, patterns: Sequence[str], after: int, limit: int, ignored: int
    ) -> tuple[list[Numbered], bool]:
        """The newest writes numbered above `after` of keys that one of `patterns` matches.

        In order of number, deletions above `ignored` included; at most `limit` of them and not
        much above `MAX_BYTES`, and whether that cut something off.
        """
        taken: list[Numbered] = []
        size = 0
        for number, write in self._newer(patterns, after):
            if write.deleted and number <= ignored:
                continue
            if len(taken) >= limit or size > MAX_BYTES:
                return taken, True
            taken.append((number, write))
            size += len(write.data) + len(write.keyexpr)
        return taken, False

    def _newer(self, patterns: Sequence[str], after: int) -> Iterator[Numbered]:
        """Goes through the changes or through the buckets, whichever are fewer."""
        fits = matcher(*patterns).fullmatch
        start = bisect_right(self._numbers, after)
        buckets = {id(b): b for pattern in patterns for b in self._buckets(pattern)}.values()
        if len(self._numbers) - start <= 2 * sum(map(len, buckets)):
            for at in range(start, len(self._numbers)):
                keyexpr = self._keys[at]
                found = self._entries.get(keyexpr)
                if found is not None and found[0] == self._numbers[at] and fits("/" + keyexpr):
                    yield found
            return
        entries = (self._entries[key] for b in buckets for key in b if fits("/" + key))
        yield from sorted((e for e in entries if e[0] > after), key=lambda entry: entry[0])

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

    def _tidy(self) -> None:
        """Drop what later changes of the same keys have replaced."""
        kept = [
            (number, keyexpr)
            for number, keyexpr in zip(self._numbers, self._keys, strict=True)
            if keyexpr in self._entries and self._entries[keyexpr][0] == number
        ]
        self._numbers = [number for number, _ in kept]
        self._keys = [keyexpr for _, keyexpr in kept]


def _path(keyexpr: str) -> list[str]:
    """The first chunks of a key, filled up; every key has the same number of them."""
    chunks = keyexpr.split("/", _DEPTH)[:_DEPTH]
    return chunks + [""] * (_DEPTH - len(chunks))
