"""What the planner wants itself is wanted until it is so: it does not end with a plan that somebody
cancels, nor with one that fails.

Nobody is there to ask for another: a robot that is to charge has no other work until it has, and
one with a thing in its hand that nobody wants can do little else. So such a goal is always in a
plan, or among `State.waiting_for_robots`: it is planned at once, or, where it was tried in vain,
when there are other robots or ways, or something of what it is about has changed.
"""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from fleet.core.charging import is_charging
from fleet.core.dispatch.charging import send_to_charge
from fleet.core.own_waiting import AT_ONCE, KEPT_SINCE_LOGIC, is_own
from fleet.core.state import State
from fleet.core.state_updates import set_goal
from keyexpr_schema.payloads.goals import GoalState

SINCE_LOGIC = 7
"""Before, such a goal waited until somebody asked for a plan."""


def plan_own_again(state: State, goals: Iterable[str]) -> State:
    """Of goals whose plan was cancelled, have those planned once more that the planner has made
    for robots. A run of a schedule is somebody's wish, and waits like any other."""
    if state.logic < SINCE_LOGIC:
        return state
    for goal in goals:
        if not is_own(state, goal) or state.goal_states[goal].state is not GoalState.WAITING:
            continue
        if is_charging(state, goal):
            for robot in state.goals[goal].by:
                state = send_to_charge(state, robot)
        else:
            at_once = state.waiting_for_robots.set(goal, AT_ONCE)
            state = replace(state, waiting_for_robots=at_once)
    return state


def keep_own(state: State, goal: str) -> State:
    """Have a goal of the planner's own that no plan works on wait to be planned: what there was no
    plan for, or was given up, until that may go otherwise."""
    if state.logic < KEPT_SINCE_LOGIC or not is_own(state, goal):
        return state
    status = state.goal_states[goal]
    if status.state is GoalState.FAILED:
        status = replace(status, state=GoalState.WAITING, plan=None)
        state = set_goal(state, status)
    planned = goal in state.index.plans_of or goal in state.waiting_for_robots
    if status.state is not GoalState.WAITING or planned:
        return state
    number = AT_ONCE if status.reason is None else state.team_number
    return replace(state, waiting_for_robots=state.waiting_for_robots.set(goal, number))
