"""When time alone is to be told to the core."""

from __future__ import annotations

import logging

from fleet.core.dispatch.activation import wakes_s
from fleet.core.dispatch.dispatcher import next_timer
from fleet.core.state import State

FIRST_PAUSE_S = 0.1
LONGEST_PAUSE_S = 60.0

log = logging.getLogger(__name__)


class Timers:
    """Says when the next timer of a state runs out.

    One that has run out, and still stands there afterwards, changed nothing: it is tried again
    after a pause that doubles, so that a fault in the core costs no more than a fault.
    """

    def __init__(self) -> None:
        self._timer_s: float | None = None
        self._fired_s: float | None = None
        self._pause_s = FIRST_PAUSE_S
        self._not_before_s = 0.0
        self._rung_s: float | None = None

    def next(self, state: State) -> float | None:
        """When the next timer runs out, by the monotonic clock [s], if there is one."""
        try:
            self._timer_s = next_timer(state)
        except Exception:
            log.exception("the next timer is not known")
            self._timer_s = None
        if self._timer_s is None or self._timer_s != self._fired_s:
            return self._timer_s
        return max(self._timer_s, self._not_before_s)

    def rings(self, state: State, time_s: float) -> bool:
        """Whether a simulation's clock shows what the core is not told yet: something is due."""
        at_s = wakes_s(state)
        if time_s < at_s or at_s == self._rung_s:
            return False
        self._rung_s = at_s
        return True

    def fired(self, now_s: float) -> None:
        """The timer that `next` gave has run out, and the core is told."""
        again = self._timer_s == self._fired_s
        self._pause_s = min(LONGEST_PAUSE_S, 2 * self._pause_s) if again else FIRST_PAUSE_S
        self._fired_s, self._not_before_s = self._timer_s, now_s + self._pause_s
