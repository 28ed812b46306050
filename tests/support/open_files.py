"""What this process has open."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def open_files() -> set[str]:
    """The numbers of its files, pipes and sockets."""
    return {each.name for each in Path("/proc/self/fd").iterdir()}


@contextmanager
def nothing_stays_open() -> Iterator[None]:
    """What is opened in the block is closed in it."""
    before = open_files()
    yield
    assert open_files() <= before
