"""What a process does while its disk is full: it waits, and says so, and goes on.

What must last is done once it is on disk. While it cannot be, nothing is done about it: what was
confirmed is kept, and nobody is told of what was not.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import os
import sqlite3
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")
RETRY_S = 1.0
_FULL = frozenset({sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR})
"""Primary result codes: there is no room, and the system refused to write (a quota, a limit)."""
_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})
FREE_SOME = "free some room there, and try again"

log = logging.getLogger(__name__)


def is_full(error: BaseException) -> bool:
    """Whether a file could not be written for want of room; what was written is as it was."""
    if isinstance(error, OSError):
        return error.errno in _NO_ROOM
    code = getattr(error, "sqlite_errorcode", None)
    return code is not None and code & 0xFF in _FULL


def without_room(folder: Path) -> bool:
    """Whether the disk of a folder is full to the last block."""
    return os.statvfs(folder).f_bavail == 0


def _said(error: Exception) -> str:
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)


class FullDisk:
    """Does what writes to `folder`, and again until there is room.

    `who` writes there, and `meanwhile` is what that means for people while it cannot. `tell` hears
    a sentence when there is no room, and `None` when there is again.
    """

    def __init__(
        self,
        folder: Path,
        who: str,
        meanwhile: str,
        tell: Callable[[str | None], None],
        retry_s: float = RETRY_S,
    ) -> None:
        self.retry_s = retry_s
        self._folder, self._who, self._meanwhile = folder, who, meanwhile
        self._tell = tell
        self._waiting = False

    async def written(self, work: Callable[[], T]) -> T:
        """The result of `work`, which does everything or nothing.

        Raises:
            sqlite3.Error, OSError: it failed for another reason than want of room.
        """

        async def at_once() -> T:
            return work()

        return await self._once_there_is_room(at_once)

    async def synced(self, sync: Callable[[], None]) -> None:
        """Return when `sync`, which takes a while and is called in a thread, has succeeded.

        Raises:
            OSError: it failed for another reason than want of room.
        """
        await self._once_there_is_room(lambda: asyncio.to_thread(sync))

    async def _once_there_is_room(self, work: Callable[[], Awaitable[T]]) -> T:
        while True:
            try:
                result = await work()
            except (sqlite3.Error, OSError) as error:
                self.found(error)
                await asyncio.sleep(self.retry_s)
            else:
                self.over()
                return result

    def found(self, error: Exception) -> None:
        """There is no room.

        Raises:
            Exception: the error, if it is another one.
        """
        if not is_full(error):
            raise error
        if self._waiting:
            return
        self._waiting = True
        sentence = (
            f"{self._who} cannot write to {self._folder} ({_said(error)}): {self._meanwhile} until "
            "there is room; free some, and it goes on by itself"
        )
        log.error("%s", sentence)
        self._tell(sentence)

    def over(self) -> None:
        """Something could be written."""
        if self._waiting:
            self._waiting = False
            log.warning("%s can write to %s again, and goes on", self._who, self._folder)
            self._tell(None)
