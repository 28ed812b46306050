"""How far the clock of this host is from that of the store's: measured, refused beyond a bound.

The latest value of a key wins by its writer's clock. A writer that is behind is overtaken by what
is older; what one writes that is ahead nobody can change until that time has come, and Zenoh gives
it another stamp beyond half a second. So nobody takes part whose clock is off by more than
`MOST_S`; what is less is shown. Stamps that went ahead with the clock, and do not come back with
it, begin anew.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Protocol

from keyexpr_schema.errors import ClockSkewed

MOST_S = 0.4
"""Zenoh's own bound for stamps that are ahead is 0.5 s."""
WORTH_SAYING_S = 0.1
MEASUREMENTS = 3
"""The one with the quickest answer counts."""
AGAIN_S, WRONG_AGAIN_S = 30.0, 1.0
"""How often it is looked again, and while it is wrong. Whether it was set is looked at as often."""
STAMPS_AHEAD_S = 1.0
"""Stamps that are ahead by more than this begin anew: twice of what Zenoh lets pass, and a look
later, so that hardly anything can be stored with a stamp that is later than those are then."""
ASK_S = 1.0

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ClockSkew:
    """This host's clock is `ahead_s` [s] of the store's (below 0: behind), give or take
    `uncertain_s`: half of the time in which the answer came (Cristian's algorithm, 1989)."""

    ahead_s: float
    uncertain_s: float

    @property
    def too_much(self) -> bool:
        """Whether it is certainly too much to take part."""
        return abs(self.ahead_s) - self.uncertain_s > MOST_S

    @property
    def worth_saying(self) -> bool:
        """Whether people should know."""
        return abs(self.ahead_s) - self.uncertain_s > WORTH_SAYING_S

    def __str__(self) -> str:
        where = "ahead of" if self.ahead_s > 0.0 else "behind"
        return f"{span(abs(self.ahead_s))} {where} that of the router's host"


def span(seconds: float) -> str:
    """So many seconds, in words."""
    for unit, length_s in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * length_s:
            return f"{seconds / length_s:.0f} {unit}"
    return f"{seconds:.1f} s"


Ask = Callable[[float], Awaitable[float | None]]
"""Asks the store within so many seconds for its time [s, Unix]; None: none answers."""


class Stamps(Protocol):
    """What stamps by this host's clock, and does not go back with it; see `SessionStamps`."""

    def now_s(self) -> float:
        """The time of a stamp that is made now [s, Unix]."""

    def begin_anew(self, at_least_s: float) -> None:
        """Go by the host's clock again, not before that time [s, Unix]."""


class ClockWatch:
    """Looks at the clock; `latest` is what was measured last, if a store answered."""

    def __init__(self, ask: Ask, stamps: Stamps | None = None) -> None:
        self._ask, self._stamps = ask, stamps
        self._stamps_ahead = False
        """Whether they were when it was measured last."""
        self.latest: ClockSkew | None = None

    async def measure(self) -> ClockSkew | None:
        """How far it is off now; None where no store says its time."""
        found: ClockSkew | None = None
        for _ in range(MEASUREMENTS):
            asked_s, began_s = time.time(), time.monotonic()
            there_s = await self._ask(ASK_S)
            took_s = time.monotonic() - began_s
            if there_s is None:
                break
            each = ClockSkew(asked_s + took_s / 2 - there_s, took_s / 2)
            if found is None or each.uncertain_s < found.uncertain_s:
                found = each
            if abs(found.ahead_s) + found.uncertain_s <= WORTH_SAYING_S:
                break
        self.latest = found or self.latest
        return found

    async def check(self) -> bool:
        """Measure once; whether a store said its time.

        Raises:
            ClockSkewed: it is off by too much.
        """
        found = await self.measure()
        if found is not None and found.too_much:
            raise ClockSkewed(wrong(found))
        return found is not None

    async def until_right(self) -> None:
        """Measure until it is not off by too much; says once what it waits for."""
        said = False
        while (found := await self.measure()) is not None and found.too_much:
            if not said:
                _log.error("%s; nothing is done until it is", wrong(found))
                said = True
            await asyncio.sleep(WRONG_AGAIN_S)
        if said:
            _log.warning("the clock of this host is right again")

    async def watch(self) -> None:
        """Measure for ever, also when the clock was set, and say when it goes wrong."""
        was_wrong = False
        measured_s, set_to_s = time.monotonic(), _set_to_s()
        while True:
            await asyncio.sleep(WRONG_AGAIN_S)
            due = self._stamps_ahead or time.monotonic() >= measured_s + AGAIN_S
            if not due and abs(_set_to_s() - set_to_s) <= WORTH_SAYING_S:
                continue
            measured_s, set_to_s = time.monotonic(), _set_to_s()
            found = await self.measure()
            if found is None:
                continue
            if found.too_much != was_wrong:
                was_wrong = found.too_much
                if was_wrong:
                    _log.error("%s", wrong(found))
                else:
                    _log.warning("the clock of this host is right again")
            self._look_at_stamps(found)

    def _look_at_stamps(self, found: ClockSkew) -> None:
        if self._stamps is None:
            return
        there_s = time.time() - found.ahead_s
        were_ahead = self._stamps_ahead
        self._stamps_ahead = self._stamps.now_s() - there_s > STAMPS_AHEAD_S
        if were_ahead and self._stamps_ahead and not found.too_much:
            self._stamps.begin_anew(there_s + found.uncertain_s)
            self._stamps_ahead = False
            _log.warning("what is written here counts again: its time was that of a clock ahead")


def _set_to_s() -> float:
    """How far the clock of this host is from one that nobody sets [s]."""
    return time.time() - time.monotonic()


def wrong(skew: ClockSkew) -> str:
    """What is said of a clock that is too far off."""
    return (
        f"the clock of this host is {skew}, and may be {MOST_S:g} s off: set it right, as "
        "`timedatectl set-ntp true` does"
    )
