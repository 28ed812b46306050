"""Reads the end of a log, and goes on with what is written to it."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from pathlib import Path

LOOK_S = 0.2
"""A file cannot be awaited, so it is looked at so often [s, wall]."""


def last_lines(log: Path, count: int) -> tuple[int, list[str]]:
    """Where a log ends now [bytes], and its last whole lines before that.

    Raises:
        OSError: it cannot be read.
    """
    with log.open("rb") as file:
        lines = deque(file, maxlen=count)
        return file.tell(), [_text(line) for line in lines]


async def followed(log: Path, at: int) -> AsyncIterator[str]:
    """Each whole line that comes after that place, for ever."""
    rest = b""
    while True:
        with log.open("rb") as file:
            file.seek(at)
            rest += file.read()
            at = file.tell()
        *whole, rest = rest.split(b"\n")
        for line in whole:
            yield _text(line)
        await asyncio.sleep(LOOK_S)


def _text(line: bytes) -> str:
    return line.decode("utf-8", "replace").rstrip("\r\n")
