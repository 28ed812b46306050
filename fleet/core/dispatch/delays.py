"""Tasks that take far longer than predicted: others may do what their robot was to do next."""

from __future__ import annotations

from fleet.core.plan_entry import PlanEntry
from fleet.core.state import State
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState

FACTOR = 2.0
MARGIN_S = 30.0
"""A task is late when it has taken this many times its predicted duration, and this long besides:
a second try, or a while at a busy door, is nothing to change a plan for."""
SAME_CLOCK_S = 86400.0
"""The fleet's clock is Unix time where the two are no further apart than this, s."""


def _late_at_s(record: TaskRecord) -> float | None:
    """When a task that runs counts as late, on the fleet's clock, s."""
    if record.started_s is None:
        return None
    return record.started_s + FACTOR * record.duration_s + MARGIN_S


def late_task(state: State, entry: PlanEntry) -> TaskRecord | None:
    """A task that is late now, was not yet reacted to, and whose robot has more to do."""
    for record in _to_be_watched(entry):
        at_s = _late_at_s(record)
        if at_s is not None and at_s <= state.time_s:
            return record
    return None


def next_lateness(state: State) -> float | None:
    """The Unix time [s] at which the next task becomes late, where the fleet's clock tells it."""
    if abs(state.time_s - state.wall_time_s) > SAME_CLOCK_S:
        return None
    times = [
        at_s
        for entry in state.plans.values()
        if not entry.ended and entry.job is None and entry.replan is None
        for record in _to_be_watched(entry)
        if (at_s := _late_at_s(record)) is not None
    ]
    return min(times, default=None)


def behind_s(state: State, robot: str) -> float:
    """How much longer than predicted a robot's present task is expected to take, s.

    A task that is late is expected to take as long again as it has taken so far.
    """
    for entry in state.plans.values():
        for record in entry.outstanding():
            if record.robot == robot and record.started_s is not None:
                return max(0.0, state.time_s - record.started_s - record.duration_s)
    return 0.0


def _to_be_watched(entry: PlanEntry) -> list[TaskRecord]:
    """Tasks that run and were not reacted to, of robots that have more to do."""
    current = list(entry.current())
    running = [r for r in current if r.state is TaskState.RUNNING and r.task not in entry.late]
    waiting = {r.robot for r in current if r.state is TaskState.WAITING} if running else set()
    return [record for record in running if record.robot in waiting]
