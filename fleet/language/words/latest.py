"""What was made from what was given last, so that it is not made again for the same."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from operator import is_
from typing import Generic, TypeVar

Given = TypeVar("Given")
Made = TypeVar("Made")

_KEPT = 4


class Latest(Generic[Given, Made]):
    """Keeps what was made from the last few things: from the very same, unless `same` says else.

    What is given need not be hashable, and may be too large to be compared.
    """

    def __init__(self, same: Callable[[Given, Given], bool] = is_) -> None:
        self._same = same
        self._rows: deque[tuple[Given, Made]] = deque(maxlen=_KEPT)

    def of(self, given: Given, make: Callable[[], Made]) -> Made:
        """What was made from it, or else is made now."""
        for known, made in self._rows:
            if self._same(known, given):
                return made
        made = make()
        self._rows.append((given, made))
        return made
