"""Robots that are taken out: what they were to do is given to others.

A robot that is drained ends its task, and still delivers what its hand or basket carries. Then it
is planned with no more, and its plans are allocated again; what nobody else can do waits for it.
"""

from __future__ import annotations

from fleet.core.holds import drains
from fleet.core.replan_reasons import ReplanScope
from fleet.core.state import State
from fleet.core.state_updates import set_entry


def move_work_of_drained_robots(state: State) -> State:
    """A plan that counts on a drained robot is allocated again, once: what is for it even then, as
    somebody wants just this robot to do it, waits."""
    for robot, hold in drains(state).items():
        if not state.drained(robot) or robot in state.index.work:
            continue
        for plan in state.index.active:
            entry = state.plans[plan]
            busy = entry.job is not None or entry.replan is not None or entry.cancelling
            if robot in entry.team and robot in entry.index.needs and not busy:
                reason = f"robot {robot} is {hold}"
                entry = entry.to_replan(ReplanScope.REALLOCATE, reason, robots=(robot,))
                state = set_entry(state, entry)
    return state
