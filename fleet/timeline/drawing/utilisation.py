"""Utilisation: which part of the time since work began each robot has been busy, and the fleet."""

from __future__ import annotations

import math

import rerun as rr

from fleet.timeline.drawing.gantt import Lanes
from fleet.timeline.drawing.palette import FLEET, Palette
from fleet.timeline.drawing.sink import Sink, entity

STEP_S = 1.0
"""One sample a second of fleet time."""

LAG_S = 1.0
"""Samples are taken this late, so that a task record which arrives late still counts."""

SETTLED_S = 60.0
"""So long after a sample nothing changes what it says any more."""

_MAX_SAMPLES = 5_000


class Utilisation:
    """Samples the lanes. 0 is idle, 1 is busy ever since the first task of the recording began."""

    def __init__(self, sink: Sink, lanes: Lanes, palette: Palette) -> None:
        self._sink = sink
        self._lanes = lanes
        self._palette = palette
        self._next_s: float | None = None
        self._run = sink.clock.runs
        self._styled: set[str] = set()

    def advance(self, now_s: float, final: bool = False) -> None:
        """Log the samples up to `now_s` [s, fleet time]; none while nobody works."""
        if self._run != self._sink.clock.runs:
            self._run = self._sink.clock.runs
            self._next_s = None
            self._lanes.begin_again()
        start_s = self._lanes.first_s
        if start_s is None:
            return
        until_s = now_s if final else now_s - LAG_S
        if self._next_s is not None and until_s < self._next_s:
            return
        if not self._lanes.running:
            until_s = min(until_s, self._lanes.last_s)
        if self._next_s is None:
            self._next_s = start_s + STEP_S
        count = math.floor((until_s - self._next_s) / STEP_S) + 1
        if count <= 0:
            return
        step_s = STEP_S * max(1, math.ceil(count / _MAX_SAMPLES))
        times = [self._next_s + i * step_s for i in range(int(count * STEP_S / step_s))]
        self._next_s += count * STEP_S
        self._log(start_s, times)
        self._lanes.settle(times[-1] - SETTLED_S)

    def _log(self, start_s: float, times: list[float]) -> None:
        if not times:
            return
        wall = [self._sink.clock.wall_at(time_s) or 0.0 for time_s in times]
        total = [0.0] * len(times)
        for robot, lane in self._lanes.lanes.items():
            busy = [
                busy_s / (time_s - start_s)
                for busy_s, time_s in zip(lane.busy_s(start_s, times), times, strict=True)
            ]
            total = [a + b for a, b in zip(total, busy, strict=True)]
            self._send(robot, self._palette.robot(robot), 1.5, times, wall, busy)
        count = len(self._lanes.lanes)
        self._send("fleet", FLEET, 3.0, times, wall, [part / count for part in total])

    def _send(
        self,
        name: str,
        colour: tuple[int, int, int, int],
        width: float,
        times: list[float],
        wall: list[float],
        values: list[float],
    ) -> None:
        group = "all" if name == "fleet" and colour == FLEET else "robots"
        path = entity("fleet", "utilisation", group, name)
        if path not in self._styled:
            self._styled.add(path)
            self._sink.fix(path, rr.SeriesLines(colors=[colour], widths=[width], names=[name]))
        self._sink.columns(path, times, wall, rr.Scalars.columns(scalars=values))
