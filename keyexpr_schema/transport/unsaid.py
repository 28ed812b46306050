"""What has passed on the link, and the store has not said: it may never take it in."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

DOUBT_S = 1.0
"""So long after something has passed on the link the store has it, or says that it has not."""
RELIST_S = 5.0
"""Period of asking for what was missed while nothing seems wrong. Within it whoever has written
something hears that the store has lost it, and may write it again: so long what is known stands
against something older that the store says."""


class _Passed(NamedTuple):
    stamp: int
    since_s: float


class Unsaid:
    """By key, the last write that passed, until the store has said it; times are of one clock that
    nobody sets [s]. Some contest what somebody else has said of a key that goes by receipt."""

    def __init__(self) -> None:
        self._passed: dict[str, _Passed] = {}
        self._contesting: set[str] = set()

    def __contains__(self, keyexpr: str) -> bool:
        return keyexpr in self._passed

    def passed(self, keyexpr: str, stamp: int, since_s: float, *, contests: bool) -> None:
        """This was the last of its key; it counts as passed at `since_s`, which may lie ahead."""
        self._passed[keyexpr] = _Passed(stamp, since_s)
        if contests:
            self._contesting.add(keyexpr)
        else:
            self._contesting.discard(keyexpr)

    def said(self, keyexpr: str, stamp: int) -> None:
        """The store has said this."""
        passed = self._passed.get(keyexpr)
        if passed is not None and passed.stamp == stamp:
            self.drop(keyexpr)

    def drop(self, keyexpr: str) -> bool:
        """Something else has taken its place, or it is not known any more; whether it was here."""
        self._contesting.discard(keyexpr)
        return self._passed.pop(keyexpr, None) is not None

    def clear(self) -> None:
        """Whatever has passed stands."""
        self._passed.clear()
        self._contesting.clear()

    def contests(self, keyexpr: str) -> bool:
        """Whether it contradicts, at this key, what somebody else has said."""
        return keyexpr in self._contesting

    @property
    def contested(self) -> bool:
        """Whether it does at any."""
        return bool(self._contesting)

    def doubtful(self, since_s: float, known: Callable[[str], int | None]) -> dict[str, int]:
        """What has passed since then or longer, and is still what is `known`: the stamp of each
        key."""
        old = {key: each.stamp for key, each in self._passed.items() if each.since_s <= since_s}
        for keyexpr in [key for key, stamp in old.items() if known(key) != stamp]:
            self.drop(keyexpr)
            del old[keyexpr]
        return old
