"""When what a store has applied is on the disk, and whether all of it is still there.

A commit to SQLite's write-ahead log is in the hands of the system: until the log is synced it
outlives the process, but no power cut. One sync does for all commits before it, so it is left until
somebody wants to know (group commit; Gray and Reuter, "Transaction Processing", 1992, 9.4.7).

Up to which change the log was synced is noted in a small file beside it. A store that knows less
than that when it is opened has lost what was confirmed: the log was deleted, emptied or cut.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path

MARK = "synced"
_BYTES = 8


class Durability:
    """Syncs the log of the database at `path`, in which `last` is the number of the newest change.

    Thread-safe.
    """

    def __init__(self, path: Path, last: Callable[[], int]) -> None:
        self._last = last
        self._syncing = threading.Lock()
        # Of its own: other descriptors of the log do not disturb SQLite's, which locks other files.
        self._log = os.open(f"{path}-wal", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        self._mark = os.open(path.parent / MARK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        _sync_folder(path.parent)
        self._synced = -1

    def missing(self) -> int:
        """How many changes were on the disk, and are there no more; told once."""
        written = int.from_bytes(os.pread(self._mark, _BYTES, 0), "big")
        missing = max(0, written - self._last())
        if missing:
            self._note(self._last())
        return missing

    def sync(self) -> None:
        """Return when all that was applied before is on the disk.

        Raises:
            OSError: the system cannot say so.
        """
        with self._syncing:
            last = self._last()
            if last == self._synced:
                return
            os.fdatasync(self._log)
            self._note(last)
            self._synced = last

    def _note(self, number: int) -> None:
        """Not synced itself: it must never be ahead of the log, and may be behind."""
        os.pwrite(self._mark, number.to_bytes(_BYTES, "big"), 0)

    def close(self) -> None:
        """Release the files."""
        os.close(self._log)
        os.close(self._mark)


def _sync_folder(folder: Path) -> None:
    """So that the files of a folder are found after a power cut."""
    there = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(there)
    finally:
        os.close(there)
