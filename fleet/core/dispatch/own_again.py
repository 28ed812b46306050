"""What the planner wants itself does not end with a plan that somebody cancels.

Nobody is there to ask for another: a robot that is to charge has no other work until it has, and
one with a thing in its hand that nobody wants can do little else.
"""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from fleet.core.charging import is_charging
from fleet.core.dispatch.activation import AT_ONCE
from fleet.core.dispatch.charging import send_to_charge
from fleet.core.state import State
from keyexpr_schema.payloads.goals import GoalState

SINCE_LOGIC = 7
"""Before, such a goal waited until somebody asked for a plan."""


def plan_own_again(state: State, goals: Iterable[str]) -> State:
    """Of goals whose plan was cancelled, have those planned once more that the planner has made
    for robots. A run of a schedule is somebody's wish, and waits like any other."""
    if state.logic < SINCE_LOGIC:
        return state
    for goal in goals:
        status = state.goal_states.get(goal)
        if status is None or not status.own or status.part_of is not None:
            continue
        if status.state is not GoalState.WAITING:
            continue
        if is_charging(state, goal):
            for robot in state.goals[goal].by:
                state = send_to_charge(state, robot)
        else:
            at_once = state.waiting_for_robots.set(goal, AT_ONCE)
            state = replace(state, waiting_for_robots=at_once)
    return state
