"""The recorder: changes of keys in, rows of a Rerun recording out.

It is total: whatever order values come in, and whatever they name, it draws what it can. It asks
nobody anything and writes no key.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

import rerun as rr

from fleet.timeline.clock import Clock, wall_of
from fleet.timeline.drawing import event_log
from fleet.timeline.drawing.blueprint import DEFAULT_SPAN_S, blueprint
from fleet.timeline.drawing.gantt import Lanes, call_text
from fleet.timeline.drawing.graph import Graphs
from fleet.timeline.drawing.palette import Palette
from fleet.timeline.drawing.sink import Sink, entity
from fleet.timeline.drawing.text import drawable
from fleet.timeline.drawing.utilisation import Utilisation
from fleet.timeline.drawing.world import World
from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import (
    FACT,
    GOAL_SPEC,
    GOAL_STATUS,
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
    TASK_RECORD,
    UNDECODABLE,
)
from keyexpr_schema.payloads.tasks import OrderAddress, Report, TaskRecord, TaskState

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
    FACT,
    UNDECODABLE,
)
"""The keys the recorder listens to."""

POSES = 64
"""So many poses of one body are worth a piece of the file of their own."""

_SENTENCES: dict[str, tuple[str, Callable[[Any, Any], Iterator[event_log.Line]]]] = {
    GOAL_SPEC.name: ("goals", event_log.goal),
    GOAL_STATUS.name: ("goals", event_log.goal_status),
    PLAN_SPEC.name: ("plans", event_log.plan),
    PLAN_STATUS.name: ("plans", event_log.plan_status),
    TASK_RECORD.name: ("tasks", event_log.task_record),
    ORDER.name: ("orders", event_log.order),
    FACT.name: ("facts", event_log.fact),
    ROBOT_SPEC.name: ("robots", event_log.robot_spec),
    ROBOT_STATE.name: ("robots", event_log.robot_state),
    SIM_TRUTH.name: ("truth", event_log.truth),
    UNDECODABLE.name: ("rejects", event_log.undecodable),
}

_COLOURS = {
    event_log.INFO: (205, 210, 215, 255),
    event_log.WARN: (240, 190, 80, 255),
    event_log.ERROR: (245, 105, 95, 255),
}


if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Change

    AnyChange = Change[Any, Any]


class Recorder:
    """Writes one recording.

    `stream` comes from `fleet.timeline.drawing.sink.open_stream`. Call `flush()` now and then:
    rows wait for it, at most a few hundred of each body.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._clock = Clock()
        self._palette = Palette()
        self._sink = Sink(stream, self._clock)
        self._world = World(self._sink, self._palette)
        self._lanes = Lanes(self._sink, self._palette)
        self._graphs = Graphs(self._sink)
        self._utilisation = Utilisation(self._sink, self._lanes, self._palette)
        self._known: dict[tuple[str, Any], Any] = {}
        self._doing: dict[str, tuple[str, str]] = {}  # robot -> task as (plan, task)
        self._span_s = DEFAULT_SPAN_S
        self._framed: object = None

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
                self._world.frame(frame, wall_s)
            return
        if key == SIM_CLOCK.name and value is not None:
            self._clock.tick(value.wall_time_s, value.time_s)
            self._draw()
            return
        name = (key, change.address)
        before = self._known.get(name)
        if before == value:
            return
        own_s = _own_time(change)
        if own_s:
            self._clock.anchor(wall_s, own_s)
        at_s = own_s if own_s else self._clock.fleet_at(wall_s)
        if value is None:
            del self._known[name]
            self._forget(key, change.address, at_s)
        else:
            self._known[name] = value
            self._show(key, value, at_s, wall_s)
            self._log_event(key, value, before, at_s, wall_s)
        self._graphs.draw(max(at_s, self._clock.now_s))

    def flush(self, whole: bool = True) -> None:
        """Hand what waits to the file; all of it, or poses only where there are many by now.

        Few poses in a piece cost more room than the poses themselves.
        """
        self._draw()
        self._lanes.flush()
        self._world.poses.flush(1 if whole else POSES)
        self._frame_view(final=False)
        self._sink.stream.flush(timeout_sec=10.0)

    def close(self) -> None:
        """Write what is left and close the file; nothing may be recorded afterwards."""
        self._utilisation.advance(self._clock.now_s, final=True)
        self._graphs.draw(self._clock.now_s, final=True)
        self._lanes.flush()
        self._world.poses.flush()
        self._frame_view(final=True)
        self._sink.stream.flush(timeout_sec=30.0)
        self._sink.stream.disconnect()

    # --- inside --------------------------------------------------------------------------------
    def _draw(self) -> None:
        self._utilisation.advance(self._clock.now_s)
        self._graphs.draw(self._clock.now_s)

    def _frame_view(self, final: bool) -> None:
        """Fit the layout to what there is; seldom, for it undoes what a person made of it."""
        floor = self._world.bounds.rectangle()
        if floor is None and not final:
            return
        low_s, high_s = self._span_s
        if final:
            begun_s = self._lanes.first_s
            low_s = 0.0 if begun_s is None or begun_s < 0.3 * self.now_s else begun_s - 5.0
            high_s = max(low_s + 10.0, low_s + 1.04 * (self.now_s - low_s))
        else:
            while high_s < self.now_s:
                high_s += high_s - low_s
        self._span_s = (low_s, high_s)
        framed = (floor, self._span_s, len(self._lanes.lanes))
        if self._framed != framed:
            self._framed = framed
            self._sink.stream.send_blueprint(blueprint(*framed))

    def _show(self, key: str, value: Any, at_s: float, wall_s: float) -> None:
        if key == SIM_SCENE.name:
            self._world.scene(value)
        elif key == PLACE.name:
            self._world.place(value)
        elif key == ROBOT_SPEC.name:
            lane = self._lanes.robot(value.robot)
            self._lanes.show_empty(lane, at_s)
            self._world.robot(value)
        elif key == ROBOT_STATE.name:
            self._world.state(value, at_s, wall_s)
        elif key == PLAN_SPEC.name:
            self._graphs.of(value.plan).plan = value
        elif key == PLAN_STATUS.name:
            self._graphs.of(value.plan).status = value
        elif key == TASK_RECORD.name:
            self._graphs.of(value.plan).records[value.task] = value
            self._lanes.record(value, at_s)
            self._label(value, at_s)

    def _label(self, record: TaskRecord, at_s: float) -> None:
        if record.robot is None:
            return
        task = (record.plan, record.task)
        if record.state is TaskState.RUNNING:
            self._doing[record.robot] = task
            doing = call_text(record.skill, record.args, record.robot)
            self._world.robot_label(record.robot, doing, at_s, None)
        elif self._doing.get(record.robot) == task:
            del self._doing[record.robot]
            self._world.robot_label(record.robot, None, at_s, None)

    def _log_event(self, key: str, value: Any, before: Any, at_s: float, wall_s: float) -> None:
        if key == REPORT.name:
            what = self._call(value)
            for ended_s, line in event_log.tries(value, before, what):
                self._log("reports", line, ended_s, None)
            topic, lines = "reports", event_log.report(value, before, what)
        elif key in _SENTENCES:
            topic, sentences = _SENTENCES[key]
            lines = sentences(value, before)
        else:
            return
        for line in lines:
            self._log(topic, line, at_s, wall_s)

    def _log(self, topic: str, line: event_log.Line, at_s: float, wall_s: float | None) -> None:
        level, sentence = line
        text = rr.TextLog(drawable(sentence), level=level, color=_COLOURS[level])
        self._sink.log(entity("fleet", "log", topic), text, at_s, wall_s)

    def _call(self, report: Report) -> str:
        """What a report is about, in the words of its order if that is known."""
        order = self._known.get((ORDER.name, OrderAddress.of(report)))
        if order is None:
            return report.task
        return f"{call_text(order.skill, order.args, order.robot)} ({report.task})"

    def _forget(self, key: str, address: Any, at_s: float) -> None:
        if key == TASK_RECORD.name:
            self._graphs.of(address.plan).records.pop(address.task, None)
            self._lanes.drop(address.plan, address.task, at_s)
        elif key == PLAN_SPEC.name:
            self._graphs.of(address.plan).plan = None
        elif key == PLAN_STATUS.name:
            self._graphs.of(address.plan).status = None


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
