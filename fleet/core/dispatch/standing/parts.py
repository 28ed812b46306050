"""The goals that a goal makes: they come, are begun, and end; each is `part_of` the one."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.believed import all_believed
from fleet.core.dispatch.activation import activate
from fleet.core.standing import has_ended, is_maintained, is_repeated, part_name
from fleet.core.state import State
from fleet.core.state_updates import set_goal, set_spec
from keyexpr_schema.facts import LOCATED
from keyexpr_schema.payloads.goals import Goal, GoalState, GoalStatus

RETRY_S = 300.0
"""What could not be made true again is tried again after so long [s]."""
_GOOD = frozenset({GoalState.REACHED, GoalState.NOT_NEEDED})
FORESEEN_SINCE_LOGIC = 6
"""That something is not found is no failure of a text that says what is done then."""


def with_part(state: State, parent: str, part: Goal, read: GoalStatus, note: str = "") -> State:
    """The state with one more goal that this one makes, called by it and a number.

    `read` says what the part is understood as; it is not begun yet.
    """
    of = state.goal_states[parent]
    number = of.runs + 1
    while (name := part_name(parent, number)) in state.goal_states:
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
        whenever=(),
        queued_s=(),
        latest=None,
        latest_s=None,
        missed=0,
        skipped=0,
        next_s=None,
        reason=None,
        note=note or read.note,
        given_s=state.time_s,
        given_wall_s=state.wall_time_s,
    )
    state = set_goal(set_spec(state, replace(part, goal=name)), status)
    return set_goal(state, replace(of, parts=(*of.parts, name), runs=number))


def settled(state: State, status: GoalStatus) -> State:
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
        return state if status == state.goal_states[status.goal] else set_goal(state, status)
    found = [state.goal_states[part] for part in ended if part in state.goal_states]
    bad = next((p for p in found if p.state not in _GOOD and not _foreseen(state, status, p)), None)
    parts = tuple(part for part in status.parts if part not in ended)
    reason = None if again and not status.paused else status.reason
    if bad is not None:
        reason = f"goal {bad.goal} {bad.state.value}: {bad.reason or 'no reason given'}"
    status = replace(status, parts=parts, reason=reason)
    if is_maintained(spec):
        status = replace(status, next_s=None if bad is None else state.time_s + RETRY_S)
    elif not parts and status.next_s is None and not spec.whenever:
        status = replace(status, state=GoalState.FAILED if reason else GoalState.REACHED)
    return set_goal(state, status)


def begin_last_part(state: State, parent: str) -> State:
    """Begin the part that was made last: nobody is there to ask for a plan."""
    return activate(state, state.goal_states[parent].parts[-1], unasked=True)


def given_up_if_left_behind(state: State, part: str) -> State:
    """A run of a schedule that was deleted ends like any other, if nothing comes of it."""
    status = state.goal_states.get(part)
    if status is None or status.part_of is None or status.part_of in state.goal_states:
        return state
    if not _is_abandoned(state, part):
        return state
    return set_goal(state, replace(status, state=GoalState.FAILED))


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
