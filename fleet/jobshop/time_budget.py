"""How long a search may go on, by a clock that is given: seconds, or steps that are the same
everywhere.
"""

from __future__ import annotations

import time
from collections.abc import Callable

Clock = Callable[[], float]
"""Seconds since some moment."""


class StepClock:
    """A clock that goes on by `step_s` each time it is read, and stands still otherwise.

    Searches read their clock every so many iterations, so that with this one their results do not
    depend on the machine.
    """

    def __init__(self, step_s: float = 2.0**-8) -> None:
        """A power of two adds up without rounding, whenever a budget begins."""
        self._step_s = step_s
        self._now_s = 0.0

    def __call__(self) -> float:
        """The next step."""
        self._now_s += self._step_s
        return self._now_s


class OutOfTime(Exception):
    """The time was over before there was anything to answer."""


class TimeBudget:
    """So many seconds by `clock`, from now on."""

    def __init__(self, seconds: float, clock: Clock = time.perf_counter) -> None:
        self._seconds = seconds
        self._clock = clock
        self._began_s = clock()

    @property
    def seconds(self) -> float:
        """How long it is from its beginning to its end."""
        return self._seconds

    @property
    def spent(self) -> float:
        """The share that is used up: 1 or more when it is over."""
        if self._seconds <= 0.0:
            return 1.0
        return (self._clock() - self._began_s) / self._seconds

    @property
    def over(self) -> bool:
        """Whether nothing is left."""
        return self.spent >= 1.0

    @property
    def left_s(self) -> float:
        """What is left, s."""
        return max(0.0, self._seconds * (1.0 - self.spent))

    def until(self, share: float) -> TimeBudget:
        """The same budget, over as soon as `share` of it is spent."""
        part = TimeBudget(share * self._seconds, self._clock)
        part._began_s = self._began_s
        return part

    def renewed(self) -> TimeBudget:
        """As much time again, from now on."""
        return TimeBudget(self._seconds, self._clock)

    def part(self, share: float, least_s: float = 0.0) -> TimeBudget:
        """From now on, `share` of what is left, and no less than `least_s` where so much is."""
        left_s = self.left_s
        return TimeBudget(min(max(share * left_s, least_s), left_s), self._clock)


class Watch:
    """For work that has no answer before it is done: looks at a budget now and then."""

    STEPS = 64
    """Looks for which the clock is read once."""

    def __init__(self, budget: TimeBudget | None) -> None:
        self._budget = budget
        self._looks = 0

    def look(self) -> None:
        """One step more.

        Raises:
            OutOfTime: nothing is left of the budget.
        """
        self._looks += 1
        if self._budget is not None and self._looks % self.STEPS == 0 and self._budget.over:
            raise OutOfTime
