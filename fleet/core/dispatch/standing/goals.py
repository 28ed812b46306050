"""Goals that stand for others, which they make: each is `part_of` one of these.

- A *schedule* (`every`) makes a goal at each of its times (`runs`), one at a time.
- A *triggered goal* (`whenever`) makes one each time that something comes to hold: at first, if it
  does already, and then only after it did not in between. There is one at a time, too.
- A *maintenance goal* says what always or never holds, and has nothing to reach. While it stands it
  constrains every plan; where the world breaks what it says always holds, it makes a goal of that.
- A text that is *several goals*, each for a time of its own, ends with the last of them.
"""

from __future__ import annotations

from math import inf

from msgspec.structs import replace

from fleet.core.believed import all_believed
from fleet.core.dispatch.activation import activate
from fleet.core.dispatch.standing.parts import (
    begin_last_part,
    given_up_if_left_behind,
    settled,
    with_part,
)
from fleet.core.dispatch.standing.runs import run
from fleet.core.holds import schedule_paused
from fleet.core.replan_reasons import ReplanScope
from fleet.core.standing import (
    is_maintained,
    is_repeated,
    run_due_s,
    standing_constraints,
    with_times,
)
from fleet.core.state import State
from fleet.core.state_updates import set_entry, set_goal
from keyexpr_schema.payloads.goals import Goal, GoalState, GoalStatus


def begin(state: State, goal: str) -> State:
    """Begin a goal that was put, and is understood, as far as it can be begun now."""
    status = state.goal_states[goal]
    if status.state is not GoalState.STANDING:
        if not is_repeated(state.goals[goal]):
            return _activated(state, goal)
        whenever = state.goals[goal].whenever
        standing = replace(status, state=GoalState.STANDING, conditions=(), whenever=whenever)
        state = set_goal(state, standing)
    return look_again(state, goal)


def _activated(state: State, goal: str) -> State:
    """Begin a goal if it can be; what is kept constrains plans from then on, and not before."""
    state = activate(state, goal)
    if state.goal_states[goal].state is not GoalState.STANDING:
        return state
    return look_again(_constrain_plans(state, state.goals[goal]), goal)


def _constrain_plans(state: State, spec: Goal) -> State:
    """Plans that were made without what a goal keeps from now on are made again."""
    always, never = standing_constraints(state)
    for plan in state.index.active:
        entry = state.plans[plan]
        kept = {*always} <= {*entry.plan.always} and {*never} <= {*entry.plan.never}
        if not kept and not entry.cancelling:
            sentence = f"goal {spec.goal} is kept from now on"
            entry = entry.to_replan(ReplanScope.REPAIR, sentence, whole=True)
            state = set_entry(state, entry)
    return state


def look_again(state: State, goal: str) -> State:
    """Take a goal that no plan works on as far as it goes by what is so now."""
    status = state.goal_states.get(goal)
    if status is None or goal not in state.goals:
        return state
    if status.state is GoalState.PENDING:
        return _activated(state, goal)
    if status.state is not GoalState.STANDING:
        return given_up_if_left_behind(state, goal)
    spec = state.goals[goal]
    if is_repeated(spec):
        status = _paused_or_not(state, status)
    state = settled(state, status)
    if spec.every is not None:
        return run(state, spec, state.goal_states[goal])
    if status.paused:
        return state
    if spec.whenever:
        return _triggered(state, spec, state.goal_states[goal])
    if is_maintained(spec):
        return _maintain(state, spec, state.goal_states[goal])
    for part in state.goal_states[goal].parts:
        if state.goals[part].after:
            state = look_again(state, part)
    return state


def wake(state: State) -> State:
    """Look again at goals whose time has come."""
    if state.time_s < state.index.wakes_s:
        return state
    for goal in with_times(state):
        if (state.goal_states[goal].next_s or 0.0) <= state.time_s:
            state = look_again(state, goal)
    times = (state.goal_states[goal].next_s for goal in with_times(state))
    wakes_s = min((at_s for at_s in times if at_s is not None), default=inf)
    return replace(state, index=replace(state.index, wakes_s=wakes_s))


def _paused_or_not(state: State, status: GoalStatus) -> GoalStatus:
    """What a pause changes: nothing is begun; afterwards it stands by as if it was said then."""
    held = schedule_paused(state, status.goal)
    if held is None:
        return replace(status, paused=False, reason=None) if status.paused else status
    return replace(status, paused=True, reason=f"it is {held}", holds=False, again=False)


def _triggered(state: State, spec: Goal, status: GoalStatus) -> State:
    """Make the goal of one that stands by, if what it stands by for has come to hold.

    What nobody knows changes nothing: it is neither so nor was it otherwise.
    """
    holds = all_believed(state, spec.whenever)
    due = status.again or (holds is True and not status.holds)
    known = status.holds if holds is None else holds
    seen = replace(status, holds=known, again=due and bool(status.parts))
    if seen != status:
        state = set_goal(state, seen)
    if not due or seen.again:
        return state
    part = replace(spec, whenever=(), due_s=run_due_s(spec, status, state.time_s))
    return begin_last_part(with_part(state, spec.goal, part, seen), spec.goal)


def _maintain(state: State, spec: Goal, status: GoalStatus) -> State:
    """Make a goal of what shall always hold and does not."""
    if status.parts:
        return state
    world = state.world()
    broken = tuple(row for row in spec.always if not world.holds(row))
    against = [row for row in spec.never if world.holds(row)]
    reason = f"{against[0]} must never hold, and does now" if against else None
    if not broken:
        kept = replace(status, reason=reason, next_s=None)
        return state if kept == status else set_goal(state, kept)
    if status.next_s is not None and state.time_s < status.next_s:
        return state
    state = set_goal(state, replace(status, reason=reason, next_s=None))
    part = Goal(
        goal=spec.goal, text=spec.text, priority=spec.priority, ordinal=spec.ordinal, by=spec.by
    )
    read = replace(status, stages=(broken,), understood=None)
    return begin_last_part(with_part(state, spec.goal, part, read), spec.goal)
