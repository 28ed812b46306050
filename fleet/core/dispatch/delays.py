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


def late_task(state: State, entry: PlanEntry) -> TaskRecord | None:
    """A task that is late now, was not yet reacted to, and whose robot has more to do."""
    return next((task for at_s, task in _when_late(entry) if at_s <= state.time_s), None)


def next_lateness(state: State) -> float | None:
    """When the next task becomes late, by `State.monotonic_s`, where the fleet's clock tells it."""
    if abs(state.time_s - state.wall_time_s) > SAME_CLOCK_S:
        return None
    times = [
        at_s
        for entry in state.plans.values()
        if not entry.ended and entry.job is None and entry.replan is None
        for at_s, _ in _when_late(entry)
    ]
    return state.monotonic_s + min(times) - state.time_s if times else None


def _when_late(entry: PlanEntry) -> list[tuple[float, TaskRecord]]:
    """When tasks that run count as late, on the fleet's clock [s]: those that were not reacted to,
    of robots that have more to do."""
    current = list(entry.current())
    running = [r for r in current if r.state is TaskState.RUNNING and r.task not in entry.late]
    waiting = {r.robot for r in current if r.state is TaskState.WAITING} if running else set()
    return [
        (record.started_s + FACTOR * record.duration_s + MARGIN_S, record)
        for record in running
        if record.robot in waiting and record.started_s is not None
    ]
