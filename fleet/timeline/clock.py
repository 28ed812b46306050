"""Two clocks, and what is known of how one runs against the other."""

from __future__ import annotations

from bisect import bisect_left

NTP_FRACTION = 2**32
"""Zenoh timestamps count 2^-32 s since the Unix epoch (NTP64)."""

_ANCHORS = 20_000
_SPACING_S = 0.1
AGAIN_S = 1.0
"""A published clock that is further behind itself than this went back: a simulation began again."""
OLD_S = 5.0
"""What was written so long before the first tick [s, wall time], and is later by the fleet's clock,
is of an earlier run."""


def wall_of(timestamp: str) -> float | None:
    """Unix seconds of a Zenoh timestamp as text, e.g. `7386690599959157260/33`.

    `None` if it is not one.
    """
    number = timestamp.partition("/")[0]
    if not (number.isascii() and number.isdigit()):
        return None
    return int(number) / NTP_FRACTION


class Clock:
    """Fleet time against wall time, fitted to every value that carries both.

    A value that names no fleet time of its own still has a Zenoh timestamp, and is placed on the
    fleet's timeline by that: so what was stored before the recorder started stands where it
    happened. Fleet time is simulated time in a simulation, and both are seconds.
    """

    def __init__(self) -> None:
        self.now_s = 0.0
        self.runs = 0
        """How often the fleet's clock went back."""
        self._ticked_s: float | None = None
        self._wall: list[float] = []
        self._fleet: list[float] = []

    def tick(self, wall_s: float, fleet_s: float) -> None:
        """The fleet's clock shows `fleet_s` now. A clock that went back is a new run.

        What robots and planner say is ahead of the ticks, and further where a simulation is fast:
        so ticks are compared with ticks.
        """
        last_s = self._latest_before(wall_s - OLD_S) if self._ticked_s is None else self._ticked_s
        if last_s is not None and fleet_s < last_s - AGAIN_S:
            self._wall.clear()
            self._fleet.clear()
            self.now_s = fleet_s
            self.runs += 1
        self._ticked_s = fleet_s
        self.now_s = max(self.now_s, fleet_s)
        self.anchor(wall_s, fleet_s)

    def _latest_before(self, wall_s: float) -> float | None:
        at = bisect_left(self._wall, wall_s)
        return self._fleet[at - 1] if at else None

    def anchor(self, wall_s: float, fleet_s: float) -> None:
        """A value of fleet time `fleet_s` was written at `wall_s`."""
        at = bisect_left(self._wall, wall_s)
        before = at > 0
        after = at < len(self._wall)
        if before and (wall_s - self._wall[at - 1] < _SPACING_S or fleet_s < self._fleet[at - 1]):
            return
        if after and (self._wall[at] - wall_s < _SPACING_S or fleet_s > self._fleet[at]):
            return
        self._wall.insert(at, wall_s)
        self._fleet.insert(at, fleet_s)
        self.now_s = max(self.now_s, fleet_s)
        if len(self._wall) > _ANCHORS:
            # Every second one of the older half: the past needs less detail than the present.
            half = _ANCHORS // 2
            self._wall[:half] = self._wall[:half:2]
            self._fleet[:half] = self._fleet[:half:2]

    def fleet_at(self, wall_s: float) -> float:
        """Fleet time [s] at a wall time; 0 if nothing is known.

        Before the first known instant it is held there. After the last one too if somebody
        publishes the fleet's clock: then it stands still. Otherwise it goes on with wall time.
        """
        ahead_s = wall_s - self._wall[-1] if self._wall and self._ticked_s is None else 0.0
        return _between(wall_s, self._wall, self._fleet) + max(0.0, ahead_s)

    def wall_at(self, fleet_s: float) -> float | None:
        """Unix seconds at which the fleet's clock showed `fleet_s`; `None` if nothing is known."""
        return _between(fleet_s, self._fleet, self._wall) if self._fleet else None


def _between(x: float, xs: list[float], ys: list[float]) -> float:
    if not xs:
        return 0.0
    at = bisect_left(xs, x)
    if at == 0:
        return ys[0]
    if at == len(xs):
        return ys[-1]
    x0, x1, y0, y1 = xs[at - 1], xs[at], ys[at - 1], ys[at]
    return y1 if x1 <= x0 else y0 + (y1 - y0) * (x - x0) / (x1 - x0)
