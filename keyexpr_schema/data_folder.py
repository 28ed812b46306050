"""The folder where a process keeps what must last."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def usable_folder(folder: Path, whose: str, error: type[Exception]) -> Iterator[None]:
    """Make the folder, where there is none; in the block, files in it are opened.

    Raises:
        error: the folder or the files cannot be used; one sentence says whose folder it is, why
            and what to do.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as reason:
        why = "it is no directory" if folder.is_file() else reason.strerror or reason
        raise error(
            f"the {whose} directory {folder} cannot be used: {why}; "
            "name one that can be written with --data"
        ) from None
