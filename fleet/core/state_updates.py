"""Changes to the state that handlers, dispatch and revision have in common.

Nothing else changes what has an index or a document: these keep the indexes up, and note what they
touched.
"""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from fleet.core.belief_updates import touched_carriers
from fleet.core.indexes.fleet_index import (
    UNPLANNED,
    FleetIndex,
    in_set,
    priority_of,
    subjects_of,
    watched_subjects,
)
from fleet.core.indexes.plan_changes import entry_changed, order_changed
from fleet.core.indexes.plan_index import OUTSTANDING
from fleet.core.indexes.touches import Part, Touch
from fleet.core.plan_entry import SAYS_WHY_SINCE_LOGIC, PlanEntry
from fleet.core.standing import standing_constraints
from fleet.core.state import State
from fleet.core.table import Table
from keyexpr_schema.payloads.goals import (
    ENDED_GOALS,
    Condition,
    Goal,
    GoalState,
    GoalStatus,
)
from keyexpr_schema.payloads.plans import Plan, PlanState, Violation
from keyexpr_schema.payloads.requests import Answer
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState


def touch(state: State, what: Touch) -> State:
    """Note that something was changed."""
    return replace(state, touches=state.touches.and_(what))


# --- goals ---------------------------------------------------------------------------------------


def set_goal(state: State, status: GoalStatus) -> State:
    """Change what is published of a goal."""
    status = replace(status, time_s=state.time_s, wall_time_s=state.wall_time_s)
    goal_states = state.goal_states.set(status.goal, status)
    return _goal_changed(state, status.goal, goal_states)


def set_spec(state: State, spec: Goal, in_force: Goal | None = None) -> State:
    """Keep what somebody wants, with what the sentence adds; plans may get another priority."""
    goal = in_force or spec
    state = _watched_changed(state, goal.goal, goal)
    specs = state.goal_specs
    specs = specs.without(goal.goal) if goal == spec else specs.set(goal.goal, spec)
    state = replace(state, goals=state.goals.set(goal.goal, goal), goal_specs=specs)
    active = state.index.active
    for plan in state.index.plans_of.get(goal.goal, ()):
        active = active.set(plan, priority_of(state.plans[plan], state.goals))
    return replace(state, index=replace(state.index, active=active))


def _watched_changed(state: State, goal: str, spec: Goal | None) -> State:
    about = state.index.goals_watching
    was, now = watched_subjects(state.goals.get(goal)), watched_subjects(spec)
    for subject in was ^ now:
        about = in_set(about, subject, goal, subject in now)
    if about is state.index.goals_watching:
        return state
    return replace(state, index=replace(state.index, goals_watching=about))


def forget_goal(state: State, goal: str) -> State:
    """Drop a goal."""
    state = _watched_changed(state, goal, None)
    goals, specs = state.goals.without(goal), state.goal_specs.without(goal)
    state = replace(state, goals=goals, goal_specs=specs)
    return _goal_changed(state, goal, state.goal_states.without(goal))


def _goal_changed(state: State, goal: str, goal_states: Table[str, GoalStatus]) -> State:
    old, new = state.goal_states.get(goal), goal_states.get(goal)
    index, was, now = state.index, subjects_of(old), subjects_of(new)
    if was != now:
        about = index.goals_about
        for subject in was - now:
            about = in_set(about, subject, goal, False)
        for subject in now - was:
            about = in_set(about, subject, goal, True)
        index = replace(index, goals_about=about)
    before, after = old and old.state, new and new.state
    if before is not after:
        in_state = index.in_state
        if before in UNPLANNED:
            in_state = in_set(in_state, before, goal, False)
        if after in UNPLANNED:
            in_state = in_set(in_state, after, goal, True)
        index = replace(index, in_state=in_state)
    if new is not None and new.next_s is not None and new.next_s < index.wakes_s:
        index = replace(index, wakes_s=new.next_s)
    touches = state.touches.and_(Touch(Part.GOAL, goal))
    for subject in was ^ now:  # whoever carries it is reserved for this goal, or no longer
        touches = touched_carriers(state, subject, touches)
    return replace(state, goal_states=goal_states, index=index, touches=touches)


def mark_goals(
    state: State,
    goals: tuple[str, ...],
    to: GoalState,
    plan: str | None,
    reason: str | None = None,
) -> State:
    """Move those goals that have not ended to another state."""
    for goal in goals:
        status = state.goal_states.get(goal)
        if (
            status is None
            or status.state in ENDED_GOALS
            or (status.state is to and status.reason == reason and status.plan == plan)
        ):
            continue
        state = set_goal(state, replace(status, state=to, plan=plan, reason=reason))
    return state


def active_plan_of(state: State, goal: str) -> str | None:
    """The plan that works on a goal and has not ended."""
    return next(iter(state.index.plans_of.get(goal, ())), None)


def open_goals(state: State, entry: PlanEntry) -> list[str]:
    """The goals of the plan that have not ended."""
    return [
        goal
        for goal in entry.plan.goals
        if goal in state.goal_states and state.goal_states[goal].state not in ENDED_GOALS
    ]


def conditions_of(state: State, goals: Iterable[str]) -> tuple[Condition, ...]:
    """What these goals want to hold, as far as they are understood."""
    return tuple(
        condition
        for goal in goals
        if goal in state.goal_states
        for condition in state.goal_states[goal].conditions
    )


def without_goal(state: State, plan: Plan, goal: str) -> Plan:
    """The plan, answering for its other goals only; its tasks stay."""
    rest = tuple(other for other in plan.goals if other != goal)
    specs = [state.goals[other] for other in rest if other in state.goals]
    always, never = standing_constraints(state)
    return replace(
        plan,
        goals=rest,
        conditions=conditions_of(state, rest),
        always=tuple(dict.fromkeys((*(row for spec in specs for row in spec.always), *always))),
        never=tuple(dict.fromkeys((*(row for spec in specs for row in spec.never), *never))),
        sometime_before=tuple(dict.fromkeys(row for spec in specs for row in spec.sometime_before)),
        by={spec.goal: spec.by for spec in specs if spec.by},
    )


# --- plans ---------------------------------------------------------------------------------------


def set_entry(state: State, entry: PlanEntry) -> State:
    """Change what is kept of a plan."""
    name = entry.plan.plan
    known = state.plans.get(name)
    entry = replace(entry, changed_s=state.time_s, changed_wall_s=state.wall_time_s)
    entry = entry.indexed(known, state.skills)
    touches = state.touches.and_(Touch(Part.PLAN, name))
    if known is None or known.records is not entry.records:
        touches = touches.and_(Touch(Part.RECORDS, name))
    index = entry_changed(state.index, name, known, entry, state.goals)
    for goal in _left(index, known, entry):
        touches = touches.and_(Touch(Part.GOAL, goal))
    return replace(state, plans=state.plans.set(name, entry), index=index, touches=touches)


def _left(index: FleetIndex, known: PlanEntry | None, entry: PlanEntry | None) -> Iterable[str]:
    """The goals that no plan works on any more, now that the entry of one is another."""
    was = known.wanted_goals if known is not None and not known.ended else ()
    now = entry.wanted_goals if entry is not None and not entry.ended else ()
    return () if was is now else (goal for goal in was if goal not in index.plans_of)


def forget_entry(state: State, name: str) -> State:
    """Drop a plan."""
    touches = state.touches.and_(Touch(Part.PLAN, name)).and_(Touch(Part.RECORDS, name))
    known = state.plans.get(name)
    index = entry_changed(state.index, name, known, None, state.goals)
    for goal in _left(index, known, None):
        touches = touches.and_(Touch(Part.GOAL, goal))
    return replace(state, plans=state.plans.without(name), index=index, touches=touches)


def set_record(state: State, entry: PlanEntry, record: TaskRecord) -> State:
    """Change what is kept of a task; of the rest of its plan as `entry` says."""
    name = entry.plan.plan
    if state.plans.get(name) is not entry:
        state = set_entry(state, entry)
        entry = state.plans[name]
    old = entry.records[record.task]
    if record.state is not old.state:
        record = replace(record, wall_time_s=state.wall_time_s)
    records = entry.records.set(record.task, record)
    entry = replace(entry, records=records, index=entry.index.moved(old, record, records))
    index = state.index
    if (old.state in OUTSTANDING) != (record.state in OUTSTANDING):
        index = order_changed(index, record, record.state in OUTSTANDING)
    touches = state.touches.and_(Touch(Part.RECORD, name, record.task))
    return replace(state, plans=state.plans.set(name, entry), index=index, touches=touches)


def set_records(state: State, entry: PlanEntry, records: Iterable[TaskRecord]) -> State:
    """Change what is kept of some tasks of a plan, and of the rest of it as `entry` says."""
    state = set_entry(state, entry)
    for record in records:
        state = set_record(state, state.plans[entry.plan.plan], record)
    return state


def set_late_bound(state: State, entry: PlanEntry, late_s: float) -> State:
    """Note that no task of the plan becomes late before `late_s`, on the fleet's clock."""
    entry = replace(entry, index=replace(entry.index, late_s=late_s))
    return replace(state, plans=state.plans.set(entry.plan.plan, entry))


def set_given_out(state: State, entry: PlanEntry, task: str) -> State:
    """Note that a task was ordered while the plan's job is in work; this has no other effect."""
    entry = replace(entry, given_out=entry.given_out.set(task, None))
    return replace(state, plans=state.plans.set(entry.plan.plan, entry))


def cancel(state: State, entry: PlanEntry, why: str) -> State:
    """Begin to cancel a plan, and why, if that was not begun before; a planning job under way
    counts no more."""
    name = entry.plan.plan
    waiting = entry.job.request if entry.job is not None else None
    state = answer(state, waiting, False, f"plan {name} was cancelled while it was made")
    state = refuse_wishes(state, entry, f"plan {name} was cancelled")
    first = state.logic >= SAYS_WHY_SINCE_LOGIC and not entry.cancelling
    reason = why if first else entry.reason
    return set_entry(state, replace(entry, cancelling=True, job=None, wishes=(), reason=reason))


def refuse_wishes(state: State, entry: PlanEntry, reason: str) -> State:
    """Answer whatever somebody still wants of a plan, which ends."""
    for wish in entry.wishes:
        state = answer(state, wish.request, False, reason, entry.plan.plan)
    return state


def with_waiting_cancelled(entry: PlanEntry, reason: str) -> Table[str, TaskRecord]:
    """The entry's records, those of waiting tasks cancelled."""
    return entry.records.updated(
        {
            name: replace(record, state=TaskState.CANCELLED, reason=reason)
            for name, record in entry.records.items()
            if record.state is TaskState.WAITING
        }
    )


def give_up(state: State, entry: PlanEntry, reason: str, to: GoalState = GoalState.FAILED) -> State:
    """End a plan as failed, and with it those of its goals that are not reached; or, with `to`,
    have them wait for another."""
    state = refuse_wishes(state, entry, f"plan {entry.plan.plan} failed: {reason}")
    entry = replace(
        entry,
        state=PlanState.FAILED,
        reason=reason,
        reasons=(),
        wishes=(),
        records=with_waiting_cancelled(entry, "the plan failed"),
        unwanted=tuple(record.task for record in entry.outstanding()),
        job=None,
    )
    state = set_entry(state, entry)
    plan = entry.plan.plan if to is GoalState.FAILED else None
    return mark_goals(state, entry.plan.goals, to, plan, reason)


# --- requests ------------------------------------------------------------------------------------


def answer(
    state: State,
    request: str | None,
    accepted: bool,
    sentence: str,
    plan: str | None = None,
    violations: tuple[Violation, ...] = (),
) -> State:
    """Answer a request; no request, no answer."""
    if request is None:
        return state
    reply = Answer(
        request=request, accepted=accepted, sentence=sentence, plan=plan, violations=violations
    )
    return put_answer(state, reply)


def put_answer(state: State, reply: Answer) -> State:
    """Give an answer."""
    state = replace(state, answers=state.answers.set(reply.request, reply))
    return touch(state, Touch(Part.ANSWER, reply.request))
