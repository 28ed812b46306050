"""Deadlock: plans that wait for robots which they keep reserved from one another in a circle."""

from __future__ import annotations

from fleet.core.dispatch.lost_robots import lost
from fleet.core.dispatch.ready_tasks import by_priority, may_order, order_if_ready
from fleet.core.state import State


def break_deadlock(state: State) -> State:
    """Where nobody moves, one task gets its robots in spite of reservations; what that upsets is
    planned again."""
    if any(not lost(state, robot) for robot in state.index.work):
        return state
    alive = [state.plans[plan] for plan in by_priority(state, state.index.active)]
    if any(entry.job is not None for entry in alive):
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
