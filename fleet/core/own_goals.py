"""Goals that the planner makes itself, such as to put down what a robot was left with.

They have a status on their key and no spec: nobody has put them there.
"""

from __future__ import annotations

from collections.abc import Sequence

from fleet.core.effects import PLANNER_SOURCE
from fleet.core.state import State
from fleet.core.state_updates import set_goal, set_spec
from keyexpr_schema.payloads.goals import Condition, Goal, GoalState, GoalStatus

_LONGEST_NAME = 56
"""Of what a goal is called by, so that there is room for a number [characters]."""


def with_own_goal(
    state: State,
    name: str,
    text: str,
    conditions: Sequence[Condition],
    note: str,
    *,
    by: Sequence[str] = (),
    priority: int = 0,
) -> tuple[State, str]:
    """The state with one more goal, called `name`, or by that and a number, and what it is called.

    `text` says what is wanted, `note` why the planner wants it; `by` are the robots that shall do
    it. It waits for a plan.
    """
    goal, number = name[:_LONGEST_NAME], 1
    while goal in state.goal_states:
        number += 1
        goal = f"{name[:_LONGEST_NAME]}-{number}"
    wanted = tuple(conditions)
    spec = Goal(
        goal=goal,
        text=text,
        conditions=wanted,
        priority=priority,
        by=tuple(by),
        said_s=state.time_s,
        said_by=PLANNER_SOURCE,
    )
    status = GoalStatus(
        goal=goal,
        state=GoalState.WAITING,
        conditions=wanted,
        stages=(wanted,),
        understood=text,
        note=note,
        own=True,
        given_s=state.time_s,
        given_wall_s=state.wall_time_s,
    )
    return set_goal(set_spec(state, spec), status), goal
