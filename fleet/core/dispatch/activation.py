"""Goals that are not to be begun yet: until their time has come and what they wait for holds.

Whoever said "at 5 pm" or "when the cup is clean" is not there to ask for a plan then, so that such
a goal is planned without being asked for. One that is wanted only if something holds is over at
once if that does not; where nobody knows, it waits until somebody does.
"""

from __future__ import annotations

from math import inf

from msgspec.structs import replace

from fleet.core.belief_updates import conclude
from fleet.core.believed import believed
from fleet.core.closed_ways import next_opening_s
from fleet.core.dispatch.delays import SAME_CLOCK_S
from fleet.core.effects import PLANNER_SOURCE
from fleet.core.holds import schedule_paused
from fleet.core.model.recurrence import when_shown
from fleet.core.own_waiting import AT_ONCE
from fleet.core.standing import goes_on
from fleet.core.state import State
from fleet.core.state_updates import set_goal
from fleet.language.phrasing import Phrasing
from keyexpr_schema.facts import LOCATED, SEARCHED
from keyexpr_schema.payloads.goals import Condition, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.waits import WaitKind, WaitReason


def activate(state: State, goal: str, *, unasked: bool = False) -> State:
    """Begin a goal, or say what it waits for, or that it is not needed; `unasked`: nobody is there
    to ask for a plan."""
    spec, status = state.goals[goal], state.goal_states[goal]
    if (held := schedule_paused(state, goal)) is not None:
        why = held.reason or None
        paused = WaitReason(kind=WaitKind.PAUSED, goal=goal, hold=held.hold, sentence=why)
        return _pending(state, status, f"it is {held}", paused)
    if spec.not_before_s is not None and state.time_s < spec.not_before_s:
        reason = f"it is begun at {when_shown(spec, spec.not_before_s, state.time_zones())}"
        due = WaitReason(kind=WaitKind.DUE, due_s=spec.not_before_s, sentence=reason)
        return _pending(state, status, reason, due)
    if before := [name for name in spec.after if goes_on(state, name)]:
        goals = (WaitReason(kind=WaitKind.GOAL, goal=name) for name in before)
        return _pending(state, status, f"it waits until {' and '.join(before)} has ended", *goals)
    if waits := [row for row in spec.when if not believed(state, row)]:
        said = Phrasing(state.vocabulary()).all_of(waits)
        return _pending(state, status, f"it waits until {said}", _until(said))
    found = {row: _asked(state, row, spec, status) for row in spec.only_if}
    if against := next((row for row, holds in found.items() if holds is False), None):
        said = Phrasing(state.vocabulary()).condition(against)
        reason = f"it is not needed, since it is not so that {said}"
        return set_goal(state, _moved(status, GoalState.NOT_NEEDED, reason))
    if unknown := [row for row, holds in found.items() if holds is None]:
        said = Phrasing(state.vocabulary()).all_of(unknown)
        reason = f"nobody knows whether {said}: it waits to be told"
        return _pending(state, status, reason, _until(f"somebody says whether {said}"))
    to = GoalState.WAITING if status.conditions else GoalState.STANDING
    begun = set_goal(state, _moved(status, to, None))
    if to is GoalState.STANDING:
        return begun
    if unasked or status.state is GoalState.PENDING:
        at_once = begun.waiting_for_robots.set(goal, AT_ONCE)
        begun = replace(begun, waiting_for_robots=at_once)
    return begin_stage(begun, goal)


def _asked(state: State, row: Condition, spec: Goal, status: GoalStatus) -> bool | None:
    """Whether what a goal is wanted under holds. What nobody has looked for is not known; to bring
    something "if you find it" includes looking for it."""
    holds = believed(state, row)
    lost = row.value is row.negated
    if row.relation != LOCATED or lost or spec.after or holds is not False:
        return holds
    about = {subject for stage in status.stages for c in stage for subject in c.subjects}
    return True if about.issuperset(row.subjects) else None


def begin_stage(state: State, goal: str) -> State:
    """A place is searched anew for every goal that asks for it."""
    for condition in state.goal_states[goal].conditions:
        for subject in condition.subjects:
            fact = state.fact(condition.relation, subject)
            if condition.relation == SEARCHED and fact is not None and fact.value is True:
                since_s = state.time_s
                if fact.key not in state.older_facts:
                    since_s = max(since_s, fact.time_s)
                unsearched = replace(fact, value=False, source=PLANNER_SOURCE, time_s=since_s)
                state = conclude(state, unsearched)
    return state


def next_start(state: State) -> float | None:
    """As `wakes_s`, by `State.monotonic_s`; `None` where a simulation tells the time."""
    at_s = wakes_s(state)
    if at_s == inf or abs(state.time_s - state.wall_time_s) > SAME_CLOCK_S:
        return None
    return state.monotonic_s + at_s - state.time_s


def wakes_s(state: State) -> float:
    """When a goal is due next, or a closure over, on the fleet's clock [s]; infinite if none is."""
    return min(state.index.wakes_s, next_opening_s(state))


def _until(said: str) -> WaitReason:
    return WaitReason(kind=WaitKind.CONDITION, sentence=said)


def _pending(state: State, status: GoalStatus, reason: str, *waits_for: WaitReason) -> State:
    pending = _moved(status, GoalState.PENDING, reason, *waits_for)
    return state if pending == status else set_goal(state, pending)


def _moved(
    status: GoalStatus, to: GoalState, reason: str | None, *waits_for: WaitReason
) -> GoalStatus:
    next_s = min((each.due_s for each in waits_for if each.due_s is not None), default=None)
    return replace(status, state=to, reason=reason, next_s=next_s, waits_for=waits_for)
