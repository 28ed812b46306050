"""Changes to the state that handlers, dispatch and revision have in common."""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from fleet.core.plan_entry import PlanEntry
from fleet.core.state import State
from fleet.core.table import Table
from keyexpr_schema.payloads.goals import ENDED_GOALS, Condition, GoalState, GoalStatus
from keyexpr_schema.payloads.plans import Plan, PlanState, Violation
from keyexpr_schema.payloads.requests import Answer
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState
from keyexpr_schema.payloads.world import Fact

AHEAD_S = 60.0
"""A fact from further ahead than this [s] was said in an earlier era, if there was one."""
COMPARED_SINCE_LOGIC = 1
"""Before this logic of the core, only facts in reports gave way to newer ones."""


def believe(state: State, fact: Fact) -> State:
    """Believe a fact, unless a newer one is known: the newest word holds, on whatever way it came.

    One that does not say when it was said (0) is said now.
    """
    known = state.facts.get(fact.key)
    if known == fact:
        return state
    earlier = _said_in_earlier_era(state, fact)
    if known is not None and fact.time_s != 0.0 and state.logic >= COMPARED_SINCE_LOGIC:
        known_earlier = fact.key in state.older_facts
        if earlier > known_earlier or (earlier == known_earlier and fact.time_s < known.time_s):
            return state
    older = state.older_facts.without(fact.key)
    if earlier:
        older = older.set(fact.key, None)
    return replace(state, facts=state.facts.set(fact.key, fact), older_facts=older)


def _said_in_earlier_era(state: State, fact: Fact) -> bool:
    return state.era > 0 and fact.time_s > state.time_s + AHEAD_S


def conclude(state: State, fact: Fact) -> State:
    """Believe what the planner concludes itself, and so publishes."""
    believed = believe(state, fact)
    if believed is state:
        return state
    return replace(believed, concluded=state.concluded.set(fact.key, fact))


def set_goal(state: State, status: GoalStatus) -> State:
    """Change what is published of a goal."""
    status = replace(status, time_s=state.time_s, wall_time_s=state.wall_time_s)
    state = replace(state, goal_states=state.goal_states.set(status.goal, status))
    if status.state not in ENDED_GOALS:
        return state
    return replace(state, perhaps_over_goals=(*state.perhaps_over_goals, status.goal))


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
    for plan, entry in state.plans.items():
        if not entry.ended and goal in entry.wanted_goals:
            return plan
    return None


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
    return replace(plan, goals=rest, conditions=conditions_of(state, rest))


def set_entry(state: State, entry: PlanEntry) -> State:
    """Change what is kept of a plan."""
    plan = entry.plan.plan
    state = replace(state, plans=state.plans.set(plan, replace(entry, changed_s=state.time_s)))
    if not entry.ended:
        return state
    return replace(state, perhaps_over_plans=(*state.perhaps_over_plans, plan))


def set_record(state: State, entry: PlanEntry, record: TaskRecord) -> State:
    """Change what is kept of a task."""
    return set_entry(state, replace(entry, records=entry.records.set(record.task, record)))


def cancel(state: State, entry: PlanEntry) -> State:
    """Begin to cancel a plan; a planning job under way counts no more."""
    name = entry.plan.plan
    waiting = entry.job.request if entry.job is not None else None
    state = answer(state, waiting, False, f"plan {name} was cancelled while it was made")
    state = refuse_wishes(state, entry, f"plan {name} was cancelled")
    return set_entry(state, replace(entry, cancelling=True, job=None, wishes=()))


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
    return replace(state, answers=state.answers.set(request, reply))
