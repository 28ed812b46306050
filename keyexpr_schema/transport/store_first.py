"""What has passed and is to come from the store first, and what waits behind it.

What waits does so for what passed before it, and for so long only as the store may still say that:
who goes on saying things that the store does not take in holds nothing up.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import inf
from typing import Generic, NamedTuple, TypeVar

from keyexpr_schema.transport.stamps import same_session

T = TypeVar("T")

TRIES, AGAIN_S = 4, 0.02
"""How often, and how soon again [s], the store is asked for what has passed, and did not change it
as it seems."""


class _Passed(NamedTuple):
    """`number` counts what has passed; `answers` and `since_s` are of when it passed."""

    stamp: int
    number: int
    answers: int
    since_s: float


class StoreFirst(Generic[T]):
    """Of what passes, `asks` is told what the store is asked for, and `hold` what comes meanwhile;
    `now_s` is a clock that nobody sets [s]. True while something is asked for."""

    def __init__(self, now_s: Callable[[], float]) -> None:
        self._now_s = now_s
        self._asked: dict[str, tuple[_Passed, _Passed]] = {}
        """By key, what passed first, and last."""
        self._later: dict[str, int] = {}
        """By key, the stamp of what there is time to ask for."""
        self._held: deque[tuple[int, T]] = deque()
        self._number = self._answers = 0

    def __bool__(self) -> bool:
        return bool(self._asked)

    @property
    def holds(self) -> bool:
        """Whether something waits, or has to."""
        return bool(self._asked or self._held)

    def asks(self, keyexpr: str, stamp: int) -> None:
        """This has passed, and is to come from the store."""
        self._number += 1
        last = _Passed(stamp, self._number, self._answers, self._now_s())
        self._asked[keyexpr] = self._asked.get(keyexpr, (last,))[0], last

    def asks_later(self, keyexpr: str, stamp: int) -> None:
        """This has passed, and what passes now need not wait for it; `asks_now` follows."""
        self._later[keyexpr] = stamp

    def asks_now(self) -> bool:
        """What there was time for is to come from the store; whether it has not come yet."""
        later, self._later = self._later, {}
        for each in later.items():
            self.asks(*each)
        return bool(later)

    def hold(self, what: T) -> None:
        """This has passed behind it."""
        self._held.append((self._number, what))

    def came(self, keyexpr: str, stamp: int) -> None:
        """The store has said this."""
        if self._later.get(keyexpr) == stamp:
            del self._later[keyexpr]
        first, last = self._asked.get(keyexpr, (None, None))
        if first is None or last is None:
            return
        if last.stamp == stamp:
            del self._asked[keyexpr]
            if not same_session(first.stamp, stamp):
                # On the way to the store they may have crossed.
                self._asked[keyexpr] = first, first
        elif first.stamp == stamp:
            self._asked[keyexpr] = last, last

    def answered(self) -> list[T]:
        """The store was asked once more: what waits for nothing any more. What it does not say, it
        had before, or something that holds instead."""
        self._answers += 1
        for keyexpr, (first, last) in list(self._asked.items()):
            if self._is_over(last):
                del self._asked[keyexpr]
            elif self._is_over(first):
                self._asked[keyexpr] = last, last
        open_from = min((first.number for first, _ in self._asked.values()), default=inf)
        free: list[T] = []
        while self._held and self._held[0][0] < open_from:
            free.append(self._held.popleft()[1])
        return free

    def _is_over(self, passed: _Passed) -> bool:
        asked = self._answers - passed.answers
        return asked >= TRIES and self._now_s() - passed.since_s >= TRIES * AGAIN_S
