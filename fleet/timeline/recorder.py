"""The recorder: changes of keys in, rows of a Rerun recording out.

It is total: whatever order values come in, and whatever they name, it draws what it can. It asks
nobody anything, and its process writes no key but that of its own diagnostic.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import rerun as rr

from fleet.timeline.clock import Clock, wall_of
from fleet.timeline.drawing.palette import Palette
from fleet.timeline.drawing.picture import Picture
from fleet.timeline.drawing.sink import end_unused_streams
from fleet.timeline.errors import UnwritableRecording
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
        self._picture: Picture | None = Picture(stream, self._clock, self._palette)

    def __len__(self) -> int:
        """How much it remembers, in values, bars and drawings."""
        return len(self._known) + (len(self._picture) if self._picture is not None else 0)

    @property
    def calls(self) -> int:
        """How often something was handed to Rerun for this recording."""
        return self._picture.calls if self._picture is not None else 0

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
        key, value, picture = change.key.name, change.value, self._picture
        wall_s = wall_of(change.timestamp) or time.time()
        if key == SIM_FRAMES.name and value is not None:
            for frame in value.frames:
                if picture is not None:
                    picture.world.frame(frame, wall_s)
                self._frame = frame, wall_s
            return
        if key == SIM_CLOCK.name and value is not None:
            self._clock.tick(value.wall_time_s, value.time_s)
            if picture is not None:
                picture.draw(self._clock.now_s, wall_s)
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
        forgotten = list(self._known.forget())
        if picture is None:
            return
        if value is None:
            picture.remove(key, change.address, at_s)
            picture.tell(key, None, before, None, at_s, wall_s)
        else:
            order = None
            if key == REPORT.name:
                order = self._known.get((ORDER.name, OrderAddress.of(value)))
            picture.show(key, value, at_s, wall_s)
            picture.tell(key, value, before, order, at_s, wall_s)
        for plan in forgotten:
            picture.forget(plan)
        picture.draw(max(at_s, self._clock.now_s), wall_s)

    def flush(self, whole: bool = True) -> None:
        """Hand what waits to the file; all of it, or poses only where there are many by now.

        Few poses in a piece cost more room than the poses themselves.

        Raises:
            UnwritableRecording: the file can be written no more.
        """
        if self._picture is not None:
            self._written(lambda picture: picture.flush(whole), self._picture)

    def continue_in(self, stream: rr.RecordingStream) -> None:
        """Close this recording and go on in another; it begins with what is known now."""
        self.close()
        self._picture = picture = Picture(stream, self._clock, self._palette)
        now_s, wall_s = self._clock.now_s, time.time()
        for (key, _), value in self._known:
            picture.show_known(key, value, now_s, wall_s)
        if self._frame is not None:
            picture.world.frame(*self._frame)
        picture.draw(now_s, wall_s)

    def close(self) -> None:
        """Write what is left and close the file. What is recorded afterwards is remembered alone,
        for another file to begin with.

        Raises:
            UnwritableRecording: what is left could not be written.
        """
        if self._picture is not None:
            self._written(lambda picture: picture.close(), self._picture)
            self._picture = None
            end_unused_streams()

    def _written(self, work: Callable[[Picture], None], picture: Picture) -> None:
        try:
            work(picture)
        except RuntimeError as error:
            picture.give_up()
            self._picture = None
            raise UnwritableRecording(f"the recording broke off: {error}") from None


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
