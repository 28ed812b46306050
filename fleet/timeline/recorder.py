"""The recorder: changes of keys in, rows of a Rerun recording out.

It is total: whatever order values come in, and whatever they name, it draws what it can. It asks
nobody anything and writes no key.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import rerun as rr

from fleet.timeline.clock import Clock, wall_of
from fleet.timeline.drawing.palette import Palette
from fleet.timeline.drawing.picture import Picture
from fleet.timeline.drawing.sink import end_unused_streams
from fleet.timeline.known import Known
from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import (
    CLOSURE,
    FACT,
    GOAL_SPEC,
    GOAL_STATUS,
    HOLD,
    ORDER,
    PLACE,
    PLAN_SPEC,
    PLAN_STATUS,
    REPORT,
    ROBOT_SPEC,
    ROBOT_STATE,
    SIM_CLOCK,
    SIM_FRAMES,
    SIM_SCENE,
    SIM_TRUTH,
    STOP,
    STOP_RELEASE,
    TASK_RECORD,
    UNDECODABLE,
)
from keyexpr_schema.payloads.simulation import Frame
from keyexpr_schema.payloads.tasks import OrderAddress

RECORDED: tuple[Key[Any, Any], ...] = (
    SIM_SCENE,
    SIM_FRAMES,
    SIM_CLOCK,
    SIM_TRUTH,
    PLACE,
    ROBOT_SPEC,
    ROBOT_STATE,
    GOAL_SPEC,
    GOAL_STATUS,
    PLAN_SPEC,
    PLAN_STATUS,
    TASK_RECORD,
    ORDER,
    REPORT,
    HOLD,
    STOP,
    STOP_RELEASE,
    CLOSURE,
    FACT,
    UNDECODABLE,
)
"""The keys the recorder listens to."""

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Change

    AnyChange = Change[Any, Any]


class Recorder:
    """Writes one recording, or one after the other.

    `stream` comes from `fleet.timeline.drawing.sink.open_stream`. Call `flush()` now and then:
    rows wait for it, at most a few hundred of each entity.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._clock = Clock()
        self._palette = Palette()
        self._known = Known()
        self._frame: tuple[Frame, float] | None = None
        self._picture = Picture(stream, self._clock, self._palette)

    def __len__(self) -> int:
        """How much it remembers, in values, bars and drawings."""
        return len(self._known) + len(self._picture)

    @property
    def calls(self) -> int:
        """How often something was handed to Rerun for this recording."""
        return self._picture.calls

    @property
    def now_s(self) -> float:
        """Fleet time [s] of the newest value."""
        return self._clock.now_s

    def record_all(self, changes: Iterable[AnyChange]) -> None:
        """Record what was stored before: in the order in which it was written.

        First the clocks are compared, so that values without a time of their own find theirs.
        """
        backlog = sorted(changes, key=lambda change: wall_of(change.timestamp) or 0.0)
        for change in backlog:
            wall_s = wall_of(change.timestamp)
            own_s = _own_time(change)
            if wall_s is not None and own_s:
                self._clock.anchor(wall_s, own_s)
        for change in backlog:
            self.record(change)

    def record(self, change: AnyChange) -> None:
        """Record one change; a value that is already known changes nothing."""
        key, value = change.key.name, change.value
        wall_s = wall_of(change.timestamp) or time.time()
        if key == SIM_FRAMES.name and value is not None:
            for frame in value.frames:
                self._picture.world.frame(frame, wall_s)
                self._frame = frame, wall_s
            return
        if key == SIM_CLOCK.name and value is not None:
            self._clock.tick(value.wall_time_s, value.time_s)
            self._picture.draw(self._clock.now_s, wall_s)
            return
        name = (key, change.address)
        before = self._known.get(name)
        if before == value:
            return
        own_s = _own_time(change)
        if own_s:
            self._clock.anchor(wall_s, own_s)
        at_s = own_s if own_s else self._clock.fleet_at(wall_s)
        self._known.put(name, value)
        if value is None:
            self._picture.remove(key, change.address, at_s)
            self._picture.tell(key, None, before, None, at_s, wall_s)
        else:
            order = None
            if key == REPORT.name:
                order = self._known.get((ORDER.name, OrderAddress.of(value)))
            self._picture.show(key, value, at_s, wall_s)
            self._picture.tell(key, value, before, order, at_s, wall_s)
        for plan in self._known.forget():
            self._picture.forget(plan)
        self._picture.draw(max(at_s, self._clock.now_s), wall_s)

    def flush(self, whole: bool = True) -> None:
        """Hand what waits to the file; all of it, or poses only where there are many by now.

        Few poses in a piece cost more room than the poses themselves.
        """
        self._picture.flush(whole)

    def continue_in(self, stream: rr.RecordingStream) -> None:
        """Close this recording and go on in another; it begins with what is known now."""
        self._picture.close()
        self._picture = Picture(stream, self._clock, self._palette)
        end_unused_streams()
        now_s, wall_s = self._clock.now_s, time.time()
        for (key, _), value in self._known:
            self._picture.show_known(key, value, now_s, wall_s)
        if self._frame is not None:
            self._picture.world.frame(*self._frame)
        self._picture.draw(now_s, wall_s)

    def close(self) -> None:
        """Write what is left and close the file; nothing may be recorded afterwards."""
        self._picture.close()


def _own_time(change: AnyChange) -> float | None:
    """The fleet time [s] a value names for itself, if it names one."""
    value = change.value
    if value is None:
        return None
    if change.key.name in (TASK_RECORD.name, REPORT.name):
        times = (getattr(value, name, None) for name in ("ended_s", "started_s", "ordered_s"))
        return next((time_s for time_s in times if time_s is not None), None)
    own = getattr(value, "time_s", None)
    return float(own) if own else None
