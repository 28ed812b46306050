"""Why a store can write nothing, as long as that lasts: it is logged, and told to whoever asks."""

from __future__ import annotations

import logging

_log = logging.getLogger(__name__)


class Troubles:
    """Those of one store. What it takes in and what it syncs say so on threads of their own, so
    that neither takes back what the other has said."""

    def __init__(self) -> None:
        self.failing: str | None = None
        """Why the store could not take in what was put last."""
        self.unsynced: str | None = None
        """Why it could not put that on the disk."""

    def fails(self, error: Exception) -> None:
        """The store cannot write."""
        self._say(error)
        self.failing = str(error)

    def works(self) -> None:
        """The store has written something."""
        if self.failing is not None:
            self.failing = None
            self._say_over()

    def fails_to_sync(self, error: BaseException) -> None:
        """What the store has written may not be on the disk."""
        self._say(error)
        self.unsynced = str(error)

    def synced(self) -> None:
        """All that the store has written is on the disk."""
        if self.unsynced is not None:
            self.unsynced = None
            self._say_over()

    def _say(self, error: BaseException) -> None:
        if self.unsynced is None and self.failing is None:
            _log.error("%s; nothing is confirmed until it can", error)

    def _say_over(self) -> None:
        if self.unsynced is None and self.failing is None:
            _log.warning("the store can write again")
