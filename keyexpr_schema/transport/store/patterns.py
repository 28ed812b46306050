"""Which keys a pattern with wildcards matches, without Zenoh."""

from __future__ import annotations

import re
from functools import lru_cache


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
