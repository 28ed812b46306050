"""An asyncio loop that waits for nothing: simulated time passes when nobody has anything to do.

Where a loop would sleep in the operating system, this one advances the world to its next event,
or, while nothing moves, jumps to its next timer. So missions of minutes take milliseconds, always
in the same order, with the very coroutines that drive real robots.
"""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable
from typing import Any

SPEED = 1000.0
"""Simulated seconds that pass while the loop's own clock goes on by one second."""


class Deadlock(Exception):
    """Everybody waits for somebody else: no motion runs and no timer is set."""


def _deadlocked() -> None:
    raise Deadlock("nothing will ever happen again")


class _Selector(selectors.DefaultSelector):
    """Sleeps by advancing the world."""

    def __init__(self, begins_s: float) -> None:
        super().__init__()
        self.now_s = begins_s
        self.advance: Callable[[], float | None] = lambda: None
        """Lets the world reach its next event; how long that took [s], or `None`: nothing moves."""
        self.deadlocked: Callable[[], None] = _deadlocked

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready = super().select(0)
        if ready or (timeout is not None and timeout <= 0):
            return ready
        passed_s = self.advance()
        if passed_s is not None:
            self.now_s += passed_s / SPEED
        elif timeout is not None:
            self.now_s += timeout
        else:
            self.deadlocked()
        return []


class SimulatedLoop(asyncio.SelectorEventLoop):
    """A loop whose clock stands still but for what the world and its own timers take.

    Without a world (`drive`) there are its timers alone, and a `Deadlock` once none is set.
    """

    def __init__(self, begins_s: float = 0.0) -> None:
        self._sleeper = _Selector(begins_s)
        super().__init__(self._sleeper)

    def time(self) -> float:
        """Seconds on the loop's own clock."""
        return self._sleeper.now_s

    def drive(self, advance: Callable[[], float | None], deadlocked: Callable[[], None]) -> None:
        """Use this world; `deadlocked` is called when nothing will ever happen again.

        `advance` takes the world to its next event and says how many simulated seconds that took,
        or `None` where nothing moves.
        """
        self._sleeper.advance, self._sleeper.deadlocked = advance, deadlocked


def run(main: Callable[[SimulatedLoop], Any]) -> Any:
    """The result of a coroutine function that is given the loop it runs on."""
    loop = SimulatedLoop()
    with asyncio.Runner(loop_factory=lambda: loop) as runner:
        return runner.run(main(loop))
