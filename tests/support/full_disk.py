"""Disks without room."""

from __future__ import annotations

import os
import resource
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest

BALLAST = "fills-the-disk"


@contextmanager
def no_room() -> Iterator[None]:
    """In the block this process can make no file longer, as on a disk that is full."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


class SmallDisk:
    """A file system of a few megabytes, which only processes started on it see.

    `command` is a command line that runs there; the others take the id of its process.
    """

    def __init__(self, folder: Path, size: str = "2m") -> None:
        if (why := _refused()) is not None:
            pytest.skip(f"no file system can be mounted here: {why}")
        self.folder, self._size = folder, size
        folder.mkdir()

    def command(self, *command: str) -> list[str]:
        mounted = 'mount -t tmpfs -o size="$1",mode=700 tmpfs "$2" && shift 2 && exec "$@"'
        return [*_UNSHARED, "sh", "-c", mounted, "sh", self._size, str(self.folder), *command]

    def seen_by(self, pid: int) -> Path:
        """Where others find it."""
        return Path(f"/proc/{pid}/root{self.folder}")

    def fill(self, pid: int) -> None:
        with (self.seen_by(pid) / BALLAST).open("wb", buffering=0) as file:
            for piece in (65536, 1):
                try:
                    while file.write(bytes(piece)) == piece:
                        pass
                except OSError:
                    continue

    def free(self, pid: int) -> None:
        (self.seen_by(pid) / BALLAST).unlink()


_UNSHARED = ["unshare", "--mount", *(["--map-root-user"] if os.geteuid() else []), "--"]


@cache
def _refused() -> str | None:
    command = [*_UNSHARED, "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except OSError as error:
        return str(error)
    return done.stderr.strip() if done.returncode else None
