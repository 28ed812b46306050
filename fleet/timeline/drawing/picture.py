"""Everything that one recording shows, drawn from values of keys."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import rerun as rr

from fleet.timeline.clock import Clock
from fleet.timeline.drawing import event_log
from fleet.timeline.drawing.blueprint import DEFAULT_SPAN_S, blueprint
from fleet.timeline.drawing.gantt import Lanes, call_text
from fleet.timeline.drawing.palette import Palette
from fleet.timeline.drawing.poses import POSES
from fleet.timeline.drawing.sink import Sink, entity, give_up
from fleet.timeline.drawing.standstill import Standstill
from fleet.timeline.drawing.task_graph.graphs import Graphs
from fleet.timeline.drawing.text import drawable
from fleet.timeline.drawing.utilisation import Utilisation
from fleet.timeline.drawing.world import CHARGE_STEP, World
from keyexpr_schema.ids import natural_order
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
    SIM_SCENE,
    SIM_TRUTH,
    STOP,
    STOP_RELEASE,
    TASK_RECORD,
    UNDECODABLE,
)
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.robots import RobotState
from keyexpr_schema.payloads.tasks import ENDED_TASKS, Order, Report, TaskRecord, TaskState

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
_ENDING: dict[str, tuple[str, Callable[[Any, Any], Iterator[event_log.Line]]]] = {
    STOP.name: ("stops", event_log.stop),
    STOP_RELEASE.name: ("stops", event_log.stop_release),
    HOLD.name: ("holds", event_log.hold),
    CLOSURE.name: ("closures", event_log.closure),
}
"""Values that people delete to end what they stand for: that is an event, too."""

_COLOURS = {
    event_log.INFO: (205, 210, 215, 255),
    event_log.WARN: (240, 190, 80, 255),
    event_log.ERROR: (245, 105, 95, 255),
}


FLUSH_S = 10.0
"""How long Rerun may take to write what it was given [s]."""


class Picture:
    """World, Gantt chart, task graphs, utilisation and events of one recording."""

    def __init__(self, stream: rr.RecordingStream, clock: Clock, palette: Palette) -> None:
        self._clock = clock
        self._sink = Sink(stream, clock)
        self.world = World(self._sink, palette)
        self._lanes = Lanes(self._sink, palette)
        self._graphs = Graphs(self._sink)
        self._utilisation = Utilisation(self._sink, self._lanes, palette)
        self._standstill = Standstill(self._lanes, self.world)
        self._closed_until_s: dict[str, float] = {}
        self._program: tuple[str, str] | None = None
        self._charged: dict[str, float] = {}
        self._palette = palette
        self._doing: dict[str, tuple[str, str]] = {}  # robot -> task as (plan, task)
        self._span_s = DEFAULT_SPAN_S
        self._framed: object = None
        self._wall_s = 0.0

    def __len__(self) -> int:
        """How much it remembers: bars and tasks."""
        return len(self._lanes) + len(self._graphs)

    @property
    def calls(self) -> int:
        """How often something was handed to Rerun."""
        return self._sink.calls

    def show(self, key: str, value: Any, at_s: float, wall_s: float) -> None:
        """Draw a value of the key of that name."""
        if key == SIM_SCENE.name:
            self.world.scene(value)
        elif key == PLACE.name:
            self.world.place(value)
        elif key == ROBOT_SPEC.name:
            lane = self._lanes.robot(value.robot)
            self._lanes.show_empty(lane, at_s)
            self.world.robot(value)
            self._standstill.update(at_s)
        elif key == ROBOT_STATE.name:
            self.world.state(value, at_s, wall_s)
            if value.charge is not None:
                self._charge(value, at_s, wall_s)
        elif key == STOP.name:
            self._standstill.stop(value.stop, value, at_s)
        elif key == STOP_RELEASE.name:
            self._standstill.release(value.stop, value.robot, True, at_s)
        elif key == HOLD.name:
            self._standstill.hold(value.hold, value, at_s)
        elif key == CLOSURE.name:
            self._close(value, at_s, wall_s)
        elif key == REPORT.name and value.program is not None:
            self._show_program(value, at_s, wall_s)
        elif key == PLAN_SPEC.name:
            self._graphs.plan(value, at_s)
        elif key == PLAN_STATUS.name:
            self._graphs.status(value.plan, value, at_s)
        elif key == TASK_RECORD.name:
            self._graphs.record(value, at_s)
            self._lanes.record(value, at_s)
            self._label(value, at_s)

    def show_known(self, key: str, value: Any, at_s: float, wall_s: float) -> None:
        """Draw what was there before this recording began: bars only of what goes on."""
        if key == TASK_RECORD.name and value.state in ENDED_TASKS:
            self._graphs.record(value, at_s)
        elif key != REPORT.name:
            self.show(key, value, at_s, wall_s)

    def remove(self, key: str, address: Any, at_s: float) -> None:
        """The value at an address of the key of that name was deleted."""
        if key == TASK_RECORD.name:
            self._graphs.drop_record(address.plan, address.task, at_s)
            self._lanes.drop(address.plan, address.task, at_s)
        elif key == PLAN_SPEC.name:
            self._graphs.drop_plan(address.plan, at_s)
        elif key == PLAN_STATUS.name:
            self._graphs.status(address.plan, None, at_s)
        elif key == STOP.name:
            self._standstill.stop(address.stop, None, at_s)
        elif key == STOP_RELEASE.name:
            self._standstill.release(address.stop, address.robot, False, at_s)
        elif key == HOLD.name:
            self._standstill.hold(address.hold, None, at_s)
        elif key == CLOSURE.name:
            self._closed_until_s.pop(address.closure, None)
            self.world.open_again(address.closure, at_s)

    def forget(self, plan: str) -> None:
        """The plan is over, and was drawn long enough."""
        self._graphs.forget(plan, self._clock.now_s)
        self._lanes.forget(plan, self._clock.now_s)

    def tell(
        self, key: str, value: Any, before: Any, order: Order | None, at_s: float, wall_s: float
    ) -> None:
        """Say in the event log what is new in a value; `order` is that of a report, if known."""
        if key == REPORT.name and value is not None:
            what = _call(value, order)
            told = (*event_log.calls(value, before), *event_log.tries(value, before, what))
            for ended_s, line in told:
                self._log("reports", line, ended_s, None)
            topic, lines = "reports", event_log.report(value, before, what)
        elif key in _ENDING:
            topic, sentences = _ENDING[key]
            lines = sentences(value, before)
        elif value is not None and key in _SENTENCES:
            topic, sentences = _SENTENCES[key]
            lines = sentences(value, before)
        else:
            return
        for line in lines:
            self._log(topic, line, at_s, wall_s)

    def draw(self, now_s: float, wall_s: float) -> None:
        """Draw the graphs that may be drawn again by now."""
        self._wall_s = wall_s
        for closure in [name for name, s in self._closed_until_s.items() if s <= now_s]:
            self.world.open_again(closure, self._closed_until_s.pop(closure))
        self._graphs.draw(now_s, wall_s)

    def flush(self, whole: bool = True) -> None:
        """Hand what waits to the file; all of it, or poses only where there are many by now.

        Raises:
            RuntimeError: it could not be written.
        """
        self._utilisation.advance(self._clock.now_s)
        self._lanes.flush(self._wall_s, final=False)
        self._sink.flush()
        self.world.poses.flush(1 if whole else POSES)
        self._frame_view(final=False)
        self._sink.stream.flush(timeout_sec=FLUSH_S)

    def close(self) -> None:
        """Write what is left and close the file; nothing may be drawn afterwards.

        Raises:
            RuntimeError: it could not be written.
        """
        now_s = self._clock.now_s
        self._utilisation.advance(now_s, final=True)
        self._graphs.draw(now_s, self._wall_s, final=True)
        self._lanes.flush()
        self._sink.flush()
        self.world.poses.flush()
        self._frame_view(final=True)
        self._sink.stream.flush(timeout_sec=FLUSH_S)
        self._sink.stream.disconnect()

    def give_up(self) -> None:
        """What is handed to the file is written no more."""
        give_up(self._sink.stream)

    # --- inside --------------------------------------------------------------------------------
    def _frame_view(self, final: bool) -> None:
        """Fit the layout to what there is; seldom, for it undoes what a person made of it."""
        now_s = self._clock.now_s
        floor = self.world.bounds.rectangle()
        if floor is None and not final:
            return
        low_s, high_s = self._span_s
        if final:
            begun_s = self._lanes.first_s
            low_s = 0.0 if begun_s is None or begun_s < 0.3 * now_s else begun_s - 5.0
            high_s = max(low_s + 10.0, low_s + 1.04 * (now_s - low_s))
        else:
            while high_s < now_s:
                high_s += high_s - low_s
        self._span_s = (low_s, high_s)
        lanes = self._lanes.lanes
        paths = tuple(
            row[robot].path
            for robot in sorted(lanes, key=natural_order)
            for row in (lanes, self._lanes.programs)
            if robot in row
        )
        wide, high = self._graphs.extent
        graphs_px = (wide, high) if final and high else None
        more = bool(self._charged), self._program is not None
        framed = (floor, self._span_s, paths, graphs_px, *more)
        if self._framed != framed:
            self._framed = framed
            # Who cannot write must be told so here: what follows waits without end.
            self._sink.stream.flush(timeout_sec=FLUSH_S)
            blueprint(*framed).send(self._sink.stream)

    def _close(self, closure: Closure, at_s: float, wall_s: float) -> None:
        if closure.is_over(at_s):
            return
        self.world.closure(closure, at_s, wall_s)
        self._closed_until_s.pop(closure.closure, None)
        if closure.until_s is not None:
            self._closed_until_s[closure.closure] = closure.until_s

    def _charge(self, state: RobotState, at_s: float, wall_s: float) -> None:
        """A point of the curve of its charge, where that is news."""
        assert state.charge is not None
        before = self._charged.get(state.robot)
        if before is not None and abs(before - state.charge) < CHARGE_STEP / 5:
            return
        path = entity("fleet", "charge", state.robot)
        if before is None:
            colour = self._palette.robot(state.robot)
            self._sink.fix(path, rr.SeriesLines(colors=[colour], names=[state.robot]))
        self._charged[state.robot] = state.charge
        self._sink.row(path, rr.Scalars, at_s, wall_s, scalars=state.charge)

    def _show_program(self, report: Report, at_s: float, wall_s: float) -> None:
        """The calls of a program as bars, and its text."""
        self._lanes.program(report)
        assert report.program is not None
        shown = (f"{report.robot}: {report.task} of {report.plan}", report.program.code.rstrip())
        if shown != self._program:
            self._program = shown
            text = drawable("### {}\n```python\n{}\n```".format(*shown))
            document = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
            self._sink.log(entity("fleet", "program"), document, at_s, wall_s)

    def _label(self, record: TaskRecord, at_s: float) -> None:
        if record.robot is None:
            return
        task = (record.plan, record.task)
        if record.state is TaskState.RUNNING:
            self._doing[record.robot] = task
            doing = call_text(record.skill, record.args, record.robot)
            self.world.robot_label(record.robot, doing, at_s, None)
        elif self._doing.get(record.robot) == task:
            del self._doing[record.robot]
            self.world.robot_label(record.robot, None, at_s, None)

    def _log(self, topic: str, line: event_log.Line, at_s: float, wall_s: float | None) -> None:
        level, sentence = line
        path = entity("fleet", "log", topic)
        self._sink.row(
            path, rr.TextLog, at_s, wall_s,
            text=drawable(sentence), level=level, color=_COLOURS[level],
        )  # fmt: skip


def _call(report: Report, order: Order | None) -> str:
    """What a report is about, in the words of its order if that is known."""
    if order is None:
        return report.task
    return f"{call_text(order.skill, order.args, order.robot)} ({report.task})"
