"""When what a store has applied is on the disk, and whether all of it is still there.

Up to which change the log was synced is noted in a small file beside it. A store that knows less
than that when it is opened has lost what was confirmed: the log was deleted, emptied or cut.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path

from fleet.stores.synced_log import SyncedLog
from keyexpr_schema.private_files import open_private

MARK = "synced"
_BYTES = 8


class Durability:
    """Syncs the log of the database at `path`, in which `last` is the number of the newest change.

    Thread-safe.
    """

    def __init__(self, path: Path, last: Callable[[], int]) -> None:
        self._last = last
        self._syncing = threading.Lock()
        self._log = SyncedLog(path)
        self._mark = open_private(path.parent / MARK, os.O_RDWR)
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
            self._log.sync()
            self._note(last)
            self._synced = last

    def _note(self, number: int) -> None:
        """Not synced itself: it must never be ahead of the log, and may be behind."""
        os.pwrite(self._mark, number.to_bytes(_BYTES, "big"), 0)

    def close(self) -> None:
        """Release the files."""
        self._log.close()
        os.close(self._mark)
