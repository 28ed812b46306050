"""The fleet's clock: a simulation's while there is one, else the time of day."""

from __future__ import annotations

import time

from fleet.core.clocks import SET_BACK_S
from fleet.core.events import At


class FleetClock:
    """What is now, for events.

    It stands while a simulation has stopped, and goes back only where a clock was set back, not
    where messages come in another order.
    """

    def __init__(self) -> None:
        self._simulated = False
        self._time_s = 0.0

    def resume(self, time_s: float, simulated: bool) -> None:
        """Go on from the planner's last time [s]; in a simulation, if there is one."""
        self._simulated, self._time_s = simulated, time_s

    def ticked(self, time_s: float) -> None:
        """A simulation's clock has been heard."""
        self._simulated = True
        if time_s > self._time_s or time_s < self._time_s - SET_BACK_S:
            self._time_s = time_s

    def reported(self, time_s: float) -> None:
        """A robot has reported something of this moment; the clock may lag behind."""
        if self._simulated:
            self._time_s = max(self._time_s, time_s)

    def at(self) -> At:
        """Now, as the fields of an event."""
        wall_time_s = time.time()
        if not self._simulated and not -SET_BACK_S <= wall_time_s - self._time_s < 0.0:
            self._time_s = wall_time_s
        return {
            "time_s": self._time_s,
            "wall_time_s": wall_time_s,
            "monotonic_s": time.monotonic(),
        }
