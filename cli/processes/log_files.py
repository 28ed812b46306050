"""Reads the end of a log, goes on with what is written to it, and keeps it from growing."""

from __future__ import annotations

import asyncio
import os
import shutil
from collections import deque
from collections.abc import AsyncIterator
from contextlib import suppress
from pathlib import Path

LOOK_S = 0.2
"""A file cannot be awaited, so it is looked at so often [s, wall]."""


LARGEST_BYTES = 20 * 2**20
"""A log that is larger begins anew; what it was is kept beside it, once."""


def cut(log: Path, largest_bytes: int = LARGEST_BYTES) -> None:
    """Begin a log anew that is too large; who writes to its end goes on, and may lose a line."""
    try:
        if log.stat().st_size > largest_bytes:
            shutil.copyfile(log, log.with_name(f"{log.name}.1"))
            os.truncate(log, 0)
    except OSError:
        return  # a disk that is full, or a log that is gone: the next time


def last_lines(log: Path, count: int) -> tuple[int, list[str]]:
    """Where a log ends now [bytes], and its last lines before that; nothing where there is none.

    Raises:
        OSError: it cannot be read.
    """
    if not log.exists():
        return 0, []
    with log.open("rb") as file:
        lines = deque(file, maxlen=count)
        return file.tell(), [_text(line) for line in lines]


async def followed(log: Path, at: int) -> AsyncIterator[str]:
    """Each whole line that comes after that place, for ever; there may be no log yet."""
    rest = b""
    while True:
        with suppress(FileNotFoundError), log.open("rb") as file:
            if file.seek(0, os.SEEK_END) < at:
                at = 0  # it was begun anew
            file.seek(at)
            rest += file.read()
            at = file.tell()
        *whole, rest = rest.split(b"\n")
        for line in whole:
            yield _text(line)
        await asyncio.sleep(LOOK_S)


def _text(line: bytes) -> str:
    return line.decode("utf-8", "replace").rstrip("\r\n")
