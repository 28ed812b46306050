"""Goals that stand for others, which they make: each is `part_of` one of these.

- A *schedule* (`every`) makes a goal at each of its times. There is one at a time: while that goes
  on, and while no planner runs, times are missed, and what was missed is done once.
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
from fleet.core.model.recurrence import recurrence_of
from fleet.core.replan_reasons import ReplanScope
from fleet.core.standing import (
    has_ended,
    is_maintained,
    is_repeated,
    standing_constraints,
    with_times,
)
from fleet.core.state import State
from fleet.core.state_updates import set_entry, set_goal, set_spec
from keyexpr_schema.facts import LOCATED
from keyexpr_schema.payloads.goals import Goal, GoalState, GoalStatus

RETRY_S = 300.0
"""What could not be made true again is tried again after so long [s]."""
_LONGEST_NAME = 56
"""Of what a part is called by, so that there is room for its number [characters]."""
_GOOD = frozenset({GoalState.REACHED, GoalState.NOT_NEEDED})
FORESEEN_SINCE_LOGIC = 6
"""That something is not found is no failure of a text that says what is done then."""


def begin(state: State, goal: str) -> State:
    """Begin a goal that was put, and is understood, as far as it can be begun now."""
    status = state.goal_states[goal]
    if status.state is not GoalState.STANDING:
        if not is_repeated(state.goals[goal]):
            return _activated(state, goal)
        state = set_goal(state, replace(status, state=GoalState.STANDING, conditions=()))
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
        return state
    state = _settled(state, status)
    spec = state.goals[goal]
    if spec.every is not None:
        return _run(state, spec, state.goal_states[goal])
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


def with_part(state: State, parent: str, part: Goal, read: GoalStatus, note: str = "") -> State:
    """The state with one more goal that this one makes, called by it and a number.

    `read` says what the part is understood as; it is not begun yet.
    """
    of = state.goal_states[parent]
    number = of.runs + 1
    while (name := f"{parent[:_LONGEST_NAME]}.{number}") in state.goal_states:
        number += 1
    status = replace(
        read,
        goal=name,
        conditions=read.stages[0] if read.stages else (),
        state=GoalState.WAITING,
        part_of=parent,
        parts=(),
        runs=0,
        holds=False,
        again=False,
        next_s=None,
        reason=None,
        note=note or read.note,
        given_s=state.time_s,
        given_wall_s=state.wall_time_s,
    )
    state = set_goal(set_spec(state, replace(part, goal=name)), status)
    return set_goal(state, replace(of, parts=(*of.parts, name), runs=number))


def _settled(state: State, status: GoalStatus) -> State:
    """Without the parts that have ended; what is several goals ends with the last of them."""
    spec = state.goals[status.goal]
    again = is_repeated(spec) or is_maintained(spec)
    if again:
        for part in status.parts:
            if _is_abandoned(state, part):
                failed = replace(state.goal_states[part], state=GoalState.FAILED)
                state = set_goal(state, failed)
    ended = [part for part in status.parts if has_ended(state, part)]
    if not ended:
        return state
    found = [state.goal_states[part] for part in ended if part in state.goal_states]
    bad = next((p for p in found if p.state not in _GOOD and not _foreseen(state, status, p)), None)
    parts = tuple(part for part in status.parts if part not in ended)
    reason = None if again else status.reason
    if bad is not None:
        reason = f"goal {bad.goal} {bad.state.value}: {bad.reason or 'no reason given'}"
    status = replace(status, parts=parts, reason=reason)
    if is_maintained(spec):
        status = replace(status, next_s=None if bad is None else state.time_s + RETRY_S)
    elif not parts and status.next_s is None and not spec.whenever:
        status = replace(status, state=GoalState.FAILED if reason else GoalState.REACHED)
    return set_goal(state, status)


def _foreseen(state: State, of: GoalStatus, failed: GoalStatus) -> bool:
    """Whether the text says what is done where that is not found which this part was to find."""
    if state.logic < FORESEEN_SINCE_LOGIC:
        return False
    sought = {name for stage in failed.stages for row in stage for name in row.subjects}
    return any(
        failed.goal in spec.after
        and any(row.relation == LOCATED and sought.issuperset(row.subjects) for row in spec.only_if)
        and all(row.value is row.negated for row in spec.only_if)
        and all_believed(state, spec.only_if) is True
        for spec in (state.goals[part] for part in of.parts if part in state.goals)
    )


def _is_abandoned(state: State, part: str) -> bool:
    """Whether there was no plan, or it was cancelled: nobody is there to ask for another one."""
    status = state.goal_states.get(part)
    return (
        status is not None
        and status.state is GoalState.WAITING
        and status.reason is not None
        and part not in state.index.plans_of
        and part not in state.waiting_for_robots
    )


def _run(state: State, spec: Goal, status: GoalStatus) -> State:
    """Make the goal of a schedule whose time has come."""
    if status.state is not GoalState.STANDING:
        return state
    if status.next_s is None and not status.runs:
        status = replace(status, next_s=recurrence_of(spec).first())
        state = set_goal(state, status)
    if status.next_s is None or state.time_s < status.next_s:
        return state
    times = recurrence_of(spec)
    count = 1 + times.missed(status.next_s, state.time_s)
    state = set_goal(state, replace(status, next_s=times.next_after(state.time_s)))
    if status.parts:
        return state  # what goes on is not begun a second time
    note = f"it is done once for {count} times that have passed" if count > 1 else ""
    part = replace(spec, every=None, not_before_s=None)
    return _begun(with_part(state, spec.goal, part, status, note), spec.goal)


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
    return _begun(with_part(state, spec.goal, replace(spec, whenever=()), seen), spec.goal)


def _begun(state: State, parent: str) -> State:
    return activate(state, state.goal_states[parent].parts[-1], unasked=True)


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
    return _begun(with_part(state, spec.goal, part, read), spec.goal)
