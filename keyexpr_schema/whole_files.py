"""Files that people read and edit, written whole or not at all."""

from __future__ import annotations

import os
import stat
from contextlib import suppress
from pathlib import Path


def write_whole(path: Path, data: bytes) -> None:
    """Make a file, or replace it in one step: where there is no room, the one before is as it was.

    Its rights stay, and a symbolic link goes on to lead to it.

    Raises:
        OSError: it cannot be written; its `filename` is `path`.
    """
    target = path.resolve()
    beside = target.with_name(f"{target.name}.new")
    try:
        if target.exists() and not target.is_file():  # a pipe, say
            target.write_bytes(data)
            return
        with beside.open("wb") as file:
            if target.exists():
                os.fchmod(file.fileno(), stat.S_IMODE(target.stat().st_mode))
            file.write(data)
        beside.replace(target)
    except OSError as error:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
        raise OSError(error.errno, error.strerror, str(path)) from None
