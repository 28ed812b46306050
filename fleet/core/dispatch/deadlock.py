"""Deadlock: plans that wait for robots which they keep reserved from one another in a circle."""

from __future__ import annotations

from collections.abc import Iterable

from fleet.core.dispatch.lost_robots import lost
from fleet.core.dispatch.ready_tasks import order_if_ready
from fleet.core.state import State
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.tasks import TaskState


def break_deadlock(state: State, plans: Iterable[str]) -> State:
    """Where nobody moves, one task gets its robots in spite of reservations; what that upsets is
    planned again. `plans` come in the order of their priority."""
    alive = [entry for entry in state.plans.values() if not entry.ended]
    if any(entry.job is not None for entry in alive):
        return state
    robots = (record.robot for entry in alive for record in entry.outstanding())
    if any(robot is not None and not lost(state, robot) for robot in robots):
        return state
    for entry in (state.plans[plan] for plan in plans):
        if entry.state is not PlanState.RUNNING or entry.replan is not None:
            continue
        for record in entry.current():
            if record.state is TaskState.WAITING:
                after = order_if_ready(state, entry.plan.plan, record, reservations=False)
                if after is not state:
                    return after
    return state
