"""Deadlock: plans that wait for robots which they keep reserved from one another in a circle."""

from __future__ import annotations

from fleet.core.dispatch.lost_robots import lost
from fleet.core.dispatch.ready_tasks import by_priority, may_order, order_if_ready
from fleet.core.state import State


def break_deadlock(state: State) -> State:
    """Where nobody moves, one task gets its robots in spite of reservations; what that upsets is
    planned again."""
    if len(state.index.work) > len(state.gone_since):
        return state  # somebody who is there is at work
    alive = [state.plans[plan] for plan in by_priority(state, state.index.active)]
    if any(entry.job is not None for entry in alive):
        return state
    robots = (record.robot for entry in alive for record in entry.outstanding())
    if any(robot is not None and not lost(state, robot) for robot in robots):
        return state
    for entry in alive:
        if not may_order(state, entry):
            continue
        ready = {task for tasks in entry.index.ready.values() for task in tasks}
        for task in sorted(ready, key=entry.index.graph.position.__getitem__):
            after = order_if_ready(state, entry.plan.plan, task, reservations=False)
            if after is not state:
                return after
    return state
