"""The Gantt chart: one lane a robot, one bar an attempt at a task; gaps are idle time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np
import rerun as rr

from fleet.timeline.drawing.palette import CANCELLED, FAILED, Palette, Rgba
from fleet.timeline.drawing.sink import Sink, entity
from fleet.timeline.drawing.text import drawable
from keyexpr_schema.facts import render_value
from keyexpr_schema.ids import actor_in
from keyexpr_schema.payloads.tasks import Report, TaskRecord, TaskState

IDLE = ""
"""The state of a robot without a task: the viewer draws a gap."""

LOOKS = 500
"""Of so many bars a lane, the latest of a file, label and colour are written: they are one list."""

FRESH = 8
"""The list goes out when one in so many is new."""

FRESH_S = 10.0
"""Or so long after the last time [s, wall time]; proportionally longer with more than 100."""


class Rank(IntEnum):
    """Of bars at the same time the one of the highest rank is seen; tasks alone are work."""

    HOLD = 0
    TASK = 1
    STOP = 2


@dataclass
class Bar:
    """One attempt of a robot at a task, from `start_s` to `end_s` [s, fleet time]; or a time in
    which it is held back."""

    key: str
    label: str
    colour: Rgba
    start_s: float
    end_s: float | None = None
    rank: Rank = Rank.TASK


@dataclass
class Lane:
    """The bars of one robot, by `plan/task#attempt`: those that may still change."""

    path: str
    bars: dict[str, Bar] = field(default_factory=dict)
    logged: dict[float, str] = field(default_factory=dict)
    """What was logged as holding from a time on."""
    looks: dict[str, tuple[str, Rgba]] = field(default_factory=dict)
    """Label and colour of the latest bars."""
    news: int = 0
    """How many looks are new since they were logged at `written_s` [s, wall time]."""
    written_s: float = float("-inf")
    settled_s: float = float("-inf")
    """Bars that ended before are counted in `settled_busy_s`, and forgotten."""
    settled_busy_s: float = 0.0

    def at(self, time_s: float) -> Bar | None:
        """The bar that covers `time_s`: of several that of the highest rank, which began last."""
        covering = [
            bar
            for bar in self.bars.values()
            if bar.start_s <= time_s and (bar.end_s is None or time_s < bar.end_s)
        ]
        return max(covering, key=lambda bar: (bar.rank, bar.start_s), default=None)

    @property
    def work(self) -> list[Bar]:
        """The bars of tasks."""
        return [bar for bar in self.bars.values() if bar.rank is Rank.TASK]

    def busy_s(self, start_s: float, ends_s: Sequence[float]) -> list[float]:
        """Seconds from `start_s` to each of `ends_s` that a bar covers; overlapping count once.

        `start_s` is no later than the first bar; `ends_s` ascend, and none is before what is
        settled.
        """
        reach = max(start_s, self.settled_s)
        until_s, total = ends_s[-1], self.settled_busy_s
        corners, totals = [reach], [total]
        for low, high in sorted(
            (bar.start_s, until_s if bar.end_s is None else bar.end_s) for bar in self.work
        ):
            if high > reach:
                low = max(low, reach)
                total += high - low
                corners += (low, high)
                totals += (totals[-1], total)
                reach = high
        busy: list[float] = np.interp(ends_s, corners, totals).tolist()
        return busy

    def look(self, bar: Bar) -> None:
        """The label and the colour of a bar are news."""
        self.looks.pop(bar.key, None)
        self.looks[bar.key] = bar.label, bar.colour
        if len(self.looks) > LOOKS:
            del self.looks[next(iter(self.looks))]
        self.news += 1

    def settle(self, before_s: float) -> None:
        """Count what ended before, and forget it."""
        if before_s <= self.settled_s:
            return
        (self.settled_busy_s,) = self.busy_s(self.settled_s, [before_s])
        self.settled_s = before_s
        for key in [k for k, b in self.bars.items() if b.end_s is not None and b.end_s < before_s]:
            del self.bars[key]
        for at_s in [at_s for at_s in self.logged if at_s < before_s]:
            del self.logged[at_s]


class Lanes:
    """Keeps the bars of every robot and logs the changes of state at their own times."""

    def __init__(self, sink: Sink, palette: Palette) -> None:
        self._sink = sink
        self._palette = palette
        self._last: dict[tuple[str, str], tuple[str, str]] = {}  # task -> robot and bar
        self._plans: dict[str, set[str]] = {}  # tasks of each plan
        self.lanes: dict[str, Lane] = {}
        self.programs: dict[str, Lane] = {}
        """A second lane of robots that run programs: their calls."""
        self.first_s: float | None = None

    def __len__(self) -> int:
        """How many bars, and ends of bars, may still change, and how many tasks have a bar."""
        lanes = (*self.lanes.values(), *self.programs.values())
        bars = sum(len(lane.bars) + len(lane.logged) for lane in lanes)
        return bars + len(self._last) + sum(map(len, self._plans.values()))

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
        self._plans.setdefault(record.plan, set()).add(record.task)
        lane = self.robot(record.robot)
        end_s = record.ended_s
        if record.state not in (TaskState.RUNNING, TaskState.ORDERED) and end_s is None:
            end_s = now_s
        if end_s is not None:
            end_s = max(end_s, record.started_s)
        if key not in lane.bars:
            first_s = record.started_s if self.first_s is None else self.first_s
            self.first_s = min(first_s, record.started_s)
        self.draw(lane, Bar(key, _label(record), self._colour(record), record.started_s, end_s))

    def draw(self, lane: Lane, now: Bar) -> None:
        """Bring a bar of a lane up to what it is now; when it began stays."""
        bar = lane.bars.get(now.key)
        if bar is None:
            bar = lane.bars[now.key] = replace(now, end_s=None)
            lane.look(bar)
            self._transition(lane, bar.start_s)
        elif (bar.label, bar.colour) != (now.label, now.colour):
            bar.label, bar.colour = now.label, now.colour
            lane.look(bar)
        if bar.end_s != now.end_s:
            bar.end_s = now.end_s
            if bar.end_s is not None:
                self._transition(lane, bar.end_s)

    def end(self, robot: str, key: str, now_s: float) -> None:
        """A bar of a robot ends now, if it has not ended yet."""
        self._close(robot, key, now_s)

    def program(self, report: Report) -> None:
        """The calls of a program that have ended, in a lane of their own."""
        calls = report.program.calls if report.program is not None else ()
        if not calls:
            return
        lane = self.programs.get(report.robot)
        if lane is None:
            path = entity("robots", report.robot, "program")
            lane = self.programs[report.robot] = Lane(path)
        for call in calls:
            key = f"{report.plan}/{report.task}#{report.attempt}.{call.number}"
            if call.ended_s <= max(call.started_s, lane.settled_s) or key in lane.bars:
                continue
            failed = call.reason is not None
            words = " ".join([call.name, *(render_value(each) for each in call.args.values())])
            label = drawable(f"{'✗ ' if failed else ''}{words}")
            colour = FAILED if failed else self._palette.skill(call.name)
            self.draw(lane, Bar(key, label, colour, call.started_s, call.ended_s))

    def flush(self, wall_s: float = 0.0, final: bool = True) -> None:
        """Log the labels and colours of bars that are new or ended otherwise than well.

        They are one list a lane and go out whole, so not at every change if it is not `final`.
        """
        for lane in (*self.lanes.values(), *self.programs.values()):
            pause_s = FRESH_S * max(1.0, len(lane.looks) / 100)
            many = lane.news * FRESH >= len(lane.looks)
            if lane.news and (final or many or not 0.0 <= wall_s - lane.written_s < pause_s):
                lane.news, lane.written_s = 0, wall_s
                self._configure(lane)

    def settle(self, before_s: float) -> None:
        """Count what ended before, and forget it."""
        for lane in (*self.lanes.values(), *self.programs.values()):
            lane.settle(before_s)

    def begin_again(self) -> None:
        """The fleet's clock went back: what was counted, and what still ran, is of another run."""
        self.first_s = None
        for lane in (*self.lanes.values(), *self.programs.values()):
            lane.bars.clear()
            lane.logged.clear()
            lane.settled_s, lane.settled_busy_s = float("-inf"), 0.0

    def drop(self, plan: str, task: str, now_s: float) -> None:
        """The planner deleted its record of a task: what still ran there ended."""
        before = self._last.pop((plan, task), None)
        if before is not None:
            self._close(*before, now_s)

    def forget(self, plan: str, now_s: float) -> None:
        """The plan is over: nothing is heard of its tasks any more."""
        for task in self._plans.pop(plan, ()):
            self.drop(plan, task, now_s)

    @property
    def running(self) -> bool:
        """Whether any bar is open."""
        return any(bar.end_s is None for lane in self.lanes.values() for bar in lane.work)

    @property
    def last_s(self) -> float:
        """The latest end of a bar [s, fleet time]."""
        return max(
            (bar.end_s or bar.start_s for lane in self.lanes.values() for bar in lane.work),
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
                self._sink.row(lane.path, rr.StateChange, at_s, None, state=state)

    def _configure(self, lane: Lane) -> None:
        looks = lane.looks
        self._sink.fix(
            lane.path,
            rr.StateConfiguration(
                values=list(looks),
                labels=[label for label, _ in looks.values()],
                colors=[colour for _, colour in looks.values()],
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
