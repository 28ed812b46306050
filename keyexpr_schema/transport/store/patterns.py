"""Which keys a pattern with wildcards matches, without Zenoh."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import lru_cache


class Patterns:
    """What a question is about: the `keys` that it names, and patterns with wildcards (`wild`).

    There may be a thousand that are one key; those are looked up, and in no expression: one of a
    thousand takes 50 ms to make.
    """

    __slots__ = ("keys", "matches", "wild")

    def __init__(self, patterns: Iterable[str]) -> None:
        self.keys: set[str] = set()
        self.wild: list[str] = []
        for each in patterns:
            if "*" in each:
                self.wild.append(each)
            else:
                self.keys.add(each)
        self.matches = self._matches()

    def _matches(self) -> Callable[[str], bool]:
        """Whether one of them matches a key."""
        keys = self.keys
        if not self.wild:
            return keys.__contains__
        fits = matcher(*self.wild).fullmatch
        if not keys:
            return lambda keyexpr: fits("/" + keyexpr) is not None
        return lambda keyexpr: keyexpr in keys or fits("/" + keyexpr) is not None


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
                parts.append(f"/{'(?!@)' if chunk.startswith('$*') else ''}{_of_chunk(chunk)}")
        wholes.append("".join(parts))
    return re.compile("|".join(wholes))


def _of_chunk(chunk: str) -> str:
    """A regular expression for a chunk with `$*`. What lies between two of them is looked for once,
    where it comes first: to try all other places as well can take for ever, and finds no more."""
    first, *others = map(re.escape, chunk.split("$*"))
    if not others:
        return first
    between = "".join(f"(?>[^/]*?{part})" for part in others[:-1])
    return f"{first}{between}[^/]*{others[-1]}"
