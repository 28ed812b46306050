"""The values of a store in memory, found by key or by key expression with wildcards."""

from __future__ import annotations

import re
from bisect import bisect_left, insort
from functools import lru_cache

from keyexpr_schema.transport.storage import Write


@lru_cache(maxsize=1024)
def matcher(pattern: str) -> re.Pattern[str]:
    """A regular expression for a Zenoh key expression: `*` one chunk, `**` any number of them.

    `$*` is any part of a chunk. As in Zenoh, wildcards do not match chunks that begin with `@`.
    https://github.com/eclipse-zenoh/roadmap/blob/main/rfcs/ALL/Key%20Expressions.md
    """
    some = r"(?!@)[^/]+"
    parts = []
    for chunk in pattern.split("/"):
        if chunk == "**":
            parts.append(rf"(?:/{some})*")
        elif chunk == "*":
            parts.append(f"/{some}")
        else:
            text = "[^/]*".join(re.escape(part) for part in chunk.split("$*"))
            parts.append(f"/{'(?!@)' if chunk.startswith('$*') else ''}{text}")
    return re.compile("".join(parts))


class Index:
    """Values by key, sorted so that a pattern looks only at keys that share its first chunks."""

    def __init__(self) -> None:
        self._values: dict[str, Write] = {}
        self._keys: list[str] = []

    def set(self, write: Write) -> None:
        """Keep `write` as the value of its key."""
        if write.keyexpr not in self._values:
            insort(self._keys, write.keyexpr)
        self._values[write.keyexpr] = write

    def remove(self, keyexpr: str) -> None:
        """Forget the value of `keyexpr`, if it has one."""
        if self._values.pop(keyexpr, None) is not None:
            del self._keys[bisect_left(self._keys, keyexpr)]

    def matching(self, pattern: str) -> list[Write]:
        """The values of every key that `pattern` matches, in order of key."""
        if "*" not in pattern:
            found = self._values.get(pattern)
            return [found] if found is not None else []
        literal = pattern[: pattern.index("*")]
        literal = literal[: literal.rfind("/") + 1]
        fits = matcher(pattern).fullmatch
        # `a/**` also matches `a`, which sorts before `a/`.
        start = bisect_left(self._keys, literal[:-1])
        result = []
        for number in range(start, len(self._keys)):
            keyexpr = self._keys[number]
            if not keyexpr.startswith(literal) and keyexpr != literal[:-1]:
                if keyexpr > literal:
                    break
                continue
            if fits("/" + keyexpr):
                result.append(self._values[keyexpr])
        return result
