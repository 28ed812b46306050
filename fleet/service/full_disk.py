"""What the planner does while its disk is full: it waits, and says so, and goes on.

An event is handled once it is on disk. While it cannot be, nothing is done about it and nothing
after it: what was confirmed is kept, and nobody is told of what was not.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")
RETRY_S = 1.0
_FULL = frozenset({sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR})
"""Primary result codes: there is no room, and the system refused to write (a quota, a limit)."""
_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})

log = logging.getLogger(__name__)


def is_full(error: sqlite3.Error | OSError) -> bool:
    """Whether the file could not be written for want of room; what was written is as it was."""
    if isinstance(error, OSError):
        return error.errno in _NO_ROOM
    code = getattr(error, "sqlite_errorcode", None)
    return code is not None and code & 0xFF in _FULL


class FullDisk:
    """Does what writes to `folder`, and again until there is room.

    `tell` hears a sentence when there is none, and `None` when there is again.
    """

    def __init__(
        self, folder: Path, tell: Callable[[str | None], None], retry_s: float = RETRY_S
    ) -> None:
        self._folder, self._tell, self._retry_s = folder, tell, retry_s
        self._waiting = False

    async def written(self, work: Callable[[], T]) -> T:
        """The result of `work`, which does everything or nothing.

        Raises:
            sqlite3.Error, OSError: it failed for another reason than want of room.
        """
        while True:
            try:
                result = work()
            except (sqlite3.Error, OSError) as error:
                if not is_full(error):
                    raise
                self.found(error)
                await asyncio.sleep(self._retry_s)
            else:
                self._over()
                return result

    def found(self, error: sqlite3.Error | OSError) -> None:
        """There is no room."""
        if self._waiting:
            return
        self._waiting = True
        sentence = (
            f"the planner cannot write to {self._folder} ({error}): nothing new is planned or "
            "ordered until there is room; free some, and it goes on by itself"
        )
        log.error("%s", sentence)
        self._tell(sentence)

    def _over(self) -> None:
        if self._waiting:
            self._waiting = False
            log.warning("the planner can write to %s again, and goes on", self._folder)
            self._tell(None)
