"""What is over leaves the state, in the event that ends it.

An answered request, a goal that was reached or given up, a plan whose last order has been reported
on: nothing will happen to them any more, and what happens to the others must not cost more the
longer the planner has lived. They stand in `State.over` until the next event, so that the shell
archives them; whoever asks about them later is answered from the archive.
"""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from fleet.core.indexes.touches import UNTOUCHED, Part, Touch
from fleet.core.plan_entry import PlanEntry
from fleet.core.state import State
from fleet.core.state_updates import (
    forget_entry,
    forget_goal,
    touch,
)
from fleet.core.table import Table
from fleet.core.view import status_of
from keyexpr_schema.payloads.goals import OVER_GOALS, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.history import GoalRecord, PlanRecord, RequestRecord

SINCE_LOGIC = 2
"""Before this logic of the core, what was over stayed."""


def let_go(state: State) -> State:
    """The state without what has come to be over in this event, which stands in `over`."""
    if state.logic < SINCE_LOGIC:
        return state
    touches = state.touches.since(UNTOUCHED)
    for plan in dict.fromkeys(t.name for t in touches if t.part in (Part.PLAN, Part.RECORD)):
        entry = state.plans.get(plan)
        if entry is not None and entry.ended and not entry.index.outstanding:
            state = _without_plan(state, entry)
    for goal in (t.name for t in touches if t.part is Part.GOAL):
        status = state.goal_states.get(goal)
        if status is not None and status.state in OVER_GOALS and not _in_its_plan(state, status):
            state = _without_goals(state, [goal], (goal_record(state, status),))
    if state.answers:
        at = {"ended_s": state.time_s, "ended_wall_s": state.wall_time_s}
        answered = (RequestRecord(answer=answer, **at) for answer in state.answers.values())
        state = replace(state, over=(*state.over, *answered), answers=Table())
    return state


def everything_perhaps_over(state: State) -> State:
    """The state of a logic that kept what was over, for this one to look through."""
    for part, names in ((Part.GOAL, state.goal_states), (Part.PLAN, state.plans)):
        for name in names:
            state = touch(state, Touch(part, name))
    return state


def goal_record(state: State, status: GoalStatus, deleted: bool = False) -> GoalRecord:
    """What is kept of a goal: since when it is as it is, unless it is deleted only now."""
    since_s, since_wall_s = status.time_s, status.wall_time_s
    if deleted or since_wall_s is None:
        since_s, since_wall_s = state.time_s, state.wall_time_s
    put = state.goal_specs.get(status.goal) or state.goals.get(status.goal)
    return GoalRecord(
        spec=put or Goal(goal=status.goal, text=""),
        status=status,
        deleted=deleted,
        ended_s=since_s,
        ended_wall_s=since_wall_s,
    )


def goal_taken_back(state: State, goal: str) -> State:
    """The state without a goal that somebody has deleted."""
    status = state.goal_states.get(goal) or GoalStatus(goal=goal, state=GoalState.WAITING)
    records = (goal_record(state, status, deleted=True),) if state.logic >= SINCE_LOGIC else ()
    return _without_goals(state, [goal], records)


def _without_plan(state: State, entry: PlanEntry) -> State:
    statuses = [state.goal_states[g] for g in entry.plan.goals if g in state.goal_states]
    record = _plan_record(state, entry, statuses)
    over = [status.goal for status in statuses if status.state in OVER_GOALS]
    state = forget_entry(state, entry.plan.plan)
    return _without_goals(state, over, (record,))


def _plan_record(state: State, entry: PlanEntry, statuses: Iterable[GoalStatus]) -> PlanRecord:
    ordered_s = [r.ordered_s for r in entry.records.values() if r.ordered_s is not None]
    begun_s = min(ordered_s, default=state.time_s) if entry.begun_s is None else entry.begun_s
    begun_wall_s = state.wall_time_s if entry.begun_wall_s is None else entry.begun_wall_s
    return PlanRecord(
        spec=entry.plan,
        status=status_of(entry),
        tasks=tuple(entry.records.values()),
        goals=tuple(goal_record(state, status) for status in statuses),
        begun_s=begun_s,
        begun_wall_s=begun_wall_s,
        ended_s=state.time_s,
        ended_wall_s=state.wall_time_s,
    )


def _without_goals(
    state: State, goals: Iterable[str], records: tuple[PlanRecord | GoalRecord, ...]
) -> State:
    for goal in goals:
        state = forget_goal(state, goal)
    return replace(state, over=(*state.over, *records))


def _in_its_plan(state: State, status: GoalStatus) -> bool:
    """Whether the plan that ended a goal still has it: then the goal leaves with its plan."""
    entry = state.plans.get(status.plan) if status.plan is not None else None
    return entry is not None and status.goal in entry.plan.goals
