"""Small changes to what is kept of plans and requests, used by every part of the core."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.handlers.goals import mark_goals
from fleet.core.state import PlanEntry, State, put
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalState
from keyexpr_schema.payloads.plans import PlanState, Violation
from keyexpr_schema.payloads.requests import Answer
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState


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
    return replace(state, answers=put(state.answers, request, reply))


def set_entry(state: State, entry: PlanEntry) -> State:
    """Change what is kept of a plan."""
    return replace(
        state, plans=put(state.plans, entry.plan.plan, replace(entry, changed_s=state.time_s))
    )


def set_record(state: State, entry: PlanEntry, record: TaskRecord) -> State:
    """Change what is kept of a task."""
    return set_entry(state, replace(entry, records=put(entry.records, record.task, record)))


def next_task(entry: PlanEntry) -> int:
    """The first number that no task of the plan has had."""
    return 1 + max((int(name[1:]) for name in entry.records if name[1:].isdigit()), default=0)


def open_goals(state: State, entry: PlanEntry) -> list[str]:
    """The goals of the plan that have not ended."""
    return [
        goal
        for goal in entry.plan.goals
        if goal in state.goal_states and state.goal_states[goal].state not in ENDED_GOALS
    ]


def give_up(state: State, entry: PlanEntry, reason: str) -> State:
    """End a plan as failed, and with it those of its goals that are not reached."""
    records = {
        name: record
        if record.state is not TaskState.WAITING
        else replace(record, state=TaskState.CANCELLED, reason="the plan failed")
        for name, record in entry.records.items()
    }
    entry = replace(
        entry,
        state=PlanState.FAILED,
        reason=reason,
        replan_reason=None,
        records=records,
        dropping=tuple(record.task for record in entry.outstanding()),
        job=None,
    )
    state = set_entry(state, entry)
    return mark_goals(state, entry.plan.goals, GoalState.FAILED, entry.plan.plan, reason)
