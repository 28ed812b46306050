"""Tasks that take far longer than predicted: others may do what their robot was to do next."""

from __future__ import annotations

from math import inf

from msgspec.structs import replace

from fleet.core.model.durations import late_at_s
from fleet.core.plan_entry import PlanEntry
from fleet.core.replan_reasons import ReplanScope
from fleet.core.state import State
from fleet.core.state_updates import (
    set_entry,
    set_late_bound,
)
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.tasks import TaskRecord

SAME_CLOCK_S = 86400.0
"""The fleet's clock is Unix time where the two are no further apart than this, s."""


def react_to_delays(state: State) -> State:
    """A plan with a task that is late now, was not yet reacted to, and whose robot has more to do,
    is reallocated."""
    for plan in state.index.active:
        entry = state.plans[plan]
        if state.time_s < entry.index.late_s or not _counts(entry):
            continue
        running = _running(state, entry)
        late = next((record for record in running if late_at_s(record) <= state.time_s), None)
        if late is None:
            state = set_late_bound(state, entry, min(map(late_at_s, running), default=inf))
            continue
        sentence = f"{late.robot} is late with {late.task} ({late.skill})"
        entry = replace(entry, late=(*entry.late, late.task))
        robots = () if late.robot is None else (late.robot,)
        entry = entry.to_replan(ReplanScope.REALLOCATE, sentence, robots=robots)
        state = set_entry(state, entry)
    return state


def next_lateness(state: State) -> float | None:
    """When the next task may become late, by `State.monotonic_s`, where the fleet's clock tells
    it."""
    if abs(state.time_s - state.wall_time_s) > SAME_CLOCK_S:
        return None
    entries = (state.plans[plan] for plan in state.index.active)
    next_s = min((entry.index.late_s for entry in entries if _counts(entry)), default=inf)
    return None if next_s == inf else state.monotonic_s + next_s - state.time_s


def _counts(entry: PlanEntry) -> bool:
    """Whether a delay would lead to anything now."""
    return entry.state is PlanState.RUNNING and entry.job is None and entry.replan is None


def _running(state: State, entry: PlanEntry) -> list[TaskRecord]:
    """The tasks of the revision that could be late: not reacted to, of robots with more to do. A
    robot that is stopped is not late."""
    position, waiting_of = entry.index.graph.position, entry.index.waiting_of
    return [
        record
        for record in entry.outstanding()
        if record.task in position
        and record.task not in entry.late
        and record.robot in waiting_of
        and not (record.robot is not None and state.stopped(record.robot))
    ]
