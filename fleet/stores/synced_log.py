"""Having the write-ahead log of an SQLite database on the disk, when somebody wants to know.

A commit to the log is in the hands of the system: until the log is synced it outlives the process,
but no power cut. One sync does for all commits before it (group commit; Gray and Reuter,
"Transaction Processing", 1992, 9.4.7), and may be done in another thread.
"""

from __future__ import annotations

import os
from pathlib import Path

from keyexpr_schema.private_files import open_private
from keyexpr_schema.whole_files import sync_folder


class SyncedLog:
    """The log of the database at `path`, which is open in WAL mode with `synchronous=NORMAL`."""

    def __init__(self, path: Path) -> None:
        # Of its own: other descriptors of the log do not disturb SQLite's, which locks other files.
        self._log = open_private(path.with_name(f"{path.name}-wal"), os.O_RDWR)
        sync_folder(path.parent)  # so that the files are found after a power cut

    def sync(self) -> None:
        """Return when all that was committed before is on the disk.

        Raises:
            OSError: the system cannot say so.
        """
        os.fdatasync(self._log)

    def close(self) -> None:
        """Release the file."""
        os.close(self._log)
