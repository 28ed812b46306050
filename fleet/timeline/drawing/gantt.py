"""The Gantt chart: one lane a robot, one bar an attempt at a task; gaps are idle time."""

from __future__ import annotations

from dataclasses import dataclass, field

import rerun as rr

from fleet.timeline.drawing.palette import CANCELLED, FAILED, Palette, Rgba
from fleet.timeline.drawing.sink import Sink, entity
from fleet.timeline.drawing.text import drawable
from keyexpr_schema.ids import actor_in
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState

IDLE = ""
"""The state of a robot without a task: the viewer draws a gap."""


@dataclass
class Bar:
    """One attempt of a robot at a task, from `start_s` to `end_s` [s, fleet time]."""

    key: str
    label: str
    colour: Rgba
    start_s: float
    end_s: float | None = None


@dataclass
class Lane:
    """The bars of one robot, by `plan/task#attempt`."""

    path: str
    bars: dict[str, Bar] = field(default_factory=dict)
    logged: dict[float, str] = field(default_factory=dict)
    """What was logged as holding from a time on."""
    dirty: bool = False

    def at(self, time_s: float) -> Bar | None:
        """The bar that covers `time_s`, the one that began last if there are several."""
        covering = [
            bar
            for bar in self.bars.values()
            if bar.start_s <= time_s and (bar.end_s is None or time_s < bar.end_s)
        ]
        return max(covering, key=lambda bar: bar.start_s, default=None)

    def busy_s(self, start_s: float, end_s: float) -> float:
        """Seconds of `start_s`…`end_s` that a bar covers; overlapping bars count once."""
        spans = sorted(
            (max(start_s, bar.start_s), min(end_s, end_s if bar.end_s is None else bar.end_s))
            for bar in self.bars.values()
        )
        total, reach = 0.0, start_s
        for low, high in spans:
            total += max(0.0, high - max(low, reach))
            reach = max(reach, high)
        return total


class Lanes:
    """Keeps the bars of every robot and logs the changes of state at their own times."""

    def __init__(self, sink: Sink, palette: Palette) -> None:
        self._sink = sink
        self._palette = palette
        self._last: dict[tuple[str, str], tuple[str, str]] = {}  # task -> robot and bar
        self.lanes: dict[str, Lane] = {}
        self.first_s: float | None = None

    def robot(self, robot: str) -> Lane:
        """The lane of a robot; made, and empty, if it is new."""
        lane = self.lanes.get(robot)
        if lane is None:
            lane = self.lanes[robot] = Lane(entity("robots", robot))
            self._palette.robot(robot)
        return lane

    def show_empty(self, lane: Lane, time_s: float) -> None:
        """Let a lane without bars be seen."""
        if not lane.bars:
            self._transition(lane, time_s)

    def record(self, record: TaskRecord, now_s: float) -> None:
        """Bring the lanes up to what the planner's record says of one task."""
        task = (record.plan, record.task)
        before = self._last.get(task)
        if record.robot is None or record.started_s is None:
            if before is not None:
                self._close(*before, now_s)
            return
        key = f"{record.plan}/{record.task}#{record.attempt}"
        if before is not None and before != (record.robot, key):
            self._close(*before, record.started_s)
        self._last[task] = (record.robot, key)
        lane = self.robot(record.robot)
        end_s = record.ended_s
        if record.state not in (TaskState.RUNNING, TaskState.ORDERED) and end_s is None:
            end_s = now_s
        if end_s is not None:
            end_s = max(end_s, record.started_s)
        bar = lane.bars.get(key)
        label, colour = _label(record), self._colour(record)
        if bar is None:
            bar = lane.bars[key] = Bar(key, label, colour, record.started_s)
            lane.dirty = True
            self._transition(lane, bar.start_s)
            first_s = bar.start_s if self.first_s is None else self.first_s
            self.first_s = min(first_s, bar.start_s)
        elif (bar.label, bar.colour) != (label, colour):
            bar.label, bar.colour = label, colour
            lane.dirty = True
        if bar.end_s != end_s:
            bar.end_s = end_s
            if end_s is not None:
                self._transition(lane, end_s)

    def flush(self) -> None:
        """Log the labels and colours of bars that are new or ended otherwise than well.

        They are one list a lane and go out whole, so not at every change.
        """
        for lane in self.lanes.values():
            if lane.dirty:
                lane.dirty = False
                self._configure(lane)

    def drop(self, plan: str, task: str, now_s: float) -> None:
        """The planner deleted its record of a task: what still ran there ended."""
        before = self._last.pop((plan, task), None)
        if before is not None:
            self._close(*before, now_s)

    @property
    def running(self) -> bool:
        """Whether any bar is open."""
        return any(bar.end_s is None for lane in self.lanes.values() for bar in lane.bars.values())

    @property
    def last_s(self) -> float:
        """The latest end of a bar [s, fleet time]."""
        return max(
            (
                bar.end_s or bar.start_s
                for lane in self.lanes.values()
                for bar in lane.bars.values()
            ),
            default=0.0,
        )

    def _close(self, robot: str, key: str, now_s: float) -> None:
        lane = self.lanes.get(robot)
        bar = lane.bars.get(key) if lane else None
        if lane is None or bar is None or bar.end_s is not None:
            return
        bar.end_s = max(now_s, bar.start_s)
        self._transition(lane, bar.end_s)

    def _transition(self, lane: Lane, time_s: float) -> None:
        # Rows may come in any order: each says what holds from its time on, and of two at the
        # same time the later row counts. So an end is never allowed to hide the next start, and
        # a bar that is heard of late corrects what was logged for later times.
        for at_s in sorted({time_s, *(later_s for later_s in lane.logged if later_s > time_s)}):
            bar = lane.at(at_s)
            state = bar.key if bar else IDLE
            if lane.logged.get(at_s) != state:
                lane.logged[at_s] = state
                self._sink.log(lane.path, rr.StateChange(state=state), at_s)

    def _configure(self, lane: Lane) -> None:
        bars = list(lane.bars.values())
        self._sink.fix(
            lane.path,
            rr.StateConfiguration(
                values=[bar.key for bar in bars],
                labels=[bar.label for bar in bars],
                colors=[bar.colour for bar in bars],
            ),
        )

    def _colour(self, record: TaskRecord) -> Rgba:
        if record.state is TaskState.FAILED:
            return FAILED
        if record.state is TaskState.CANCELLED:
            return CANCELLED
        return self._palette.skill(record.skill)


def _label(record: TaskRecord) -> str:
    mark = {TaskState.FAILED: "✗ ", TaskState.CANCELLED: "∅ "}.get(record.state, "")
    return drawable(f"{mark}{call_text(record.skill, record.args, record.robot)}")


def call_text(skill: str, args: dict[str, str], robot: str | None) -> str:
    """A skill call in a few words: `pick cup_1`; the robot itself and actors are left out."""
    words = [value for value in args.values() if value != robot and actor_in(value) is None]
    return " ".join([skill, *words])
