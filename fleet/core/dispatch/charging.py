"""Robots that are sent to charge: below the reserve, and before work that their charge is not
enough for.

The planner makes a goal of it, by that robot, with a plan of its own. Until the goal is reached the
robot has no other work: what it was to do waits, or goes to others where that is sooner done.
"""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.charging import can_charge, charging_goal, is_low
from fleet.core.handlers.requests import plan_at_once
from fleet.core.indexes.touches import Part, Touch
from fleet.core.own_goals import with_own_goal
from fleet.core.replan_reasons import ReplanScope
from fleet.core.state import State
from fleet.core.state_updates import active_plan_of, mark_goals, set_entry, touch
from keyexpr_schema.facts import CHARGE, FactKey
from keyexpr_schema.payloads.goals import Condition, GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.robots import FULL

BY_HAND_SINCE_LOGIC = 7
"""Before, a robot that was charged by hand while nobody could plan that did nothing any more."""


def look_at_charge(state: State, robot: str) -> State:
    """Send a robot to charge if it is low, and there is a charger for it. What one was to do that
    is empty is looked at: others may do it."""
    if state.is_empty(robot):
        for plan in state.index.active:
            if robot in state.plans[plan].index.needs:
                state = touch(state, Touch(Part.PLAN, plan))
        return state
    if not state.waiting_for_robots and not is_low(state, robot):
        return state  # as nearly always: all are looked at when one more robot is there
    if robot not in state.index.team or state.draining(robot):
        return state
    state = _charged_by_hand(state, robot)
    if not is_low(state, robot) or not can_charge(state, robot):
        return state
    return send_to_charge(state, robot)


def _charged_by_hand(state: State, robot: str) -> State:
    """A robot that is to charge, for which nobody could make a plan, has what was wanted when
    somebody has charged it."""
    goal = charging_goal(state, robot)
    if state.logic < BY_HAND_SINCE_LOGIC or goal is None or goal not in state.waiting_for_robots:
        return state
    status = state.goal_states[goal]
    if not status.own or not all(state.world().holds(row) for row in status.conditions):
        return state
    state = mark_goals(state, (goal,), GoalState.REACHED, None)
    waiting = state.waiting_for_robots.without(goal)
    return touch(replace(state, waiting_for_robots=waiting), Touch(Part.ROBOT, robot))


def send_to_charge(state: State, robot: str) -> State:
    """Make a goal of charging, where there is none, and a plan for it. One that is empty gets
    nowhere."""
    if state.logic >= BY_HAND_SINCE_LOGIC and state.is_empty(robot):
        return state
    goal = charging_goal(state, robot)
    if goal is None:
        state, goal = _with_goal(state, robot)
    elif active_plan_of(state, goal) or _in_vain(state, goal):
        return state
    state = plan_at_once(state, goal)
    return _move_work(touch(state, Touch(Part.ROBOT, robot)), robot)


def _in_vain(state: State, goal: str) -> bool:
    """Whether no plan was found for a goal with the robots and ways that there are."""
    return state.waiting_for_robots.get(goal) == state.team_number


def _with_goal(state: State, robot: str) -> tuple[State, str]:
    percent = state.facts[FactKey(CHARGE, robot)].value
    return with_own_goal(
        state,
        f"charge-{robot[:40]}-{state.plans_made + 1}",
        f"Charge {state.robots[robot].label or robot}",
        (Condition(relation=CHARGE, subject=robot, value=int(FULL)),),
        f"its battery is at {percent} %",
        by=(robot,),
    )


def _move_work(state: State, robot: str) -> State:
    """What the robot has not begun may be done by others meanwhile."""
    for plan in state.index.active:
        entry = state.plans[plan]
        busy = entry.job is not None or entry.replan is not None or entry.cancelling
        if entry.state is not PlanState.RUNNING or busy or robot not in entry.index.needs:
            continue
        if charging_goal(state, robot) not in entry.plan.goals:
            reason = f"robot {robot} has to charge"
            entry = entry.to_replan(ReplanScope.REALLOCATE, reason, robots=(robot,))
            state = set_entry(state, entry)
    return state
