"""What somebody has done by hand, and robots need not do."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.belief_updates import believe_effects
from fleet.core.dispatch.replan_triggers import react_to_fact
from fleet.core.indexes.plan_index import OUTSTANDING
from fleet.core.model.preconditions import action_of
from fleet.core.plan_entry import PlanEntry
from fleet.core.replan_reasons import ReplanScope
from fleet.core.state import State
from fleet.core.state_updates import answer, set_entry, set_record
from fleet.language.refusals import nearest
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import ControlRequest
from keyexpr_schema.payloads.tasks import ENDED_TASKS, Report, TaskRecord, TaskState
from keyexpr_schema.payloads.world import PERSON_SOURCE


def task_done(state: State, entry: PlanEntry, ask: ControlRequest) -> State | str:
    """Take a task as done, which somebody did by hand, or say why not.

    Its effects are believed; a robot that is at it leaves off. What is left of the plan is checked,
    and planned again where it no longer works.
    """
    record = _to_be_done(entry, ask)
    if isinstance(record, str):
        return record
    action = action_of(record, state.skills)
    if action is None:
        return f"there is no skill {record.skill} any more that says what {record.task} changes"
    by, why = (f" by {ask.by}" if ask.by else ""), (f" ({ask.reason})" if ask.reason else "")
    done = f"done by hand{by}{why}"
    known = state.facts
    state, facts = believe_effects(
        state,
        action,
        state.world(),
        source=PERSON_SOURCE,
        time_s=state.time_s,
        by=ask.by,
        of_program=record.program is not None,
    )
    for fact in facts:
        if state.facts.get(fact.key) is not known.get(fact.key):
            state = react_to_fact(state, state.facts[fact.key])
    sentence = f"{record.task} ({record.skill}) was {done}"
    entry = state.plans[ask.plan]
    entry = entry.to_replan(ReplanScope.REALLOCATE, sentence, tasks=(record.task,))
    said = f"task {record.task} of plan {ask.plan} is {done}"
    if record.state in OUTSTANDING:
        entry = replace(
            entry,
            by_hand=entry.by_hand.set(record.task, done),
            unwanted=tuple(dict.fromkeys([*entry.unwanted, record.task])),
        )
        state = set_entry(state, entry)
        said += f"; {record.robot} is told to leave off"
    else:
        ended = replace(record, state=TaskState.SUCCEEDED, reason=done, ended_s=state.time_s)
        state = set_record(state, entry, ended)
    return answer(state, ask.request, True, said, ask.plan)


def left_off(record: TaskRecord, report: Report, done: str) -> TaskRecord:
    """The record of a task that was done by hand when its robot has left off, however that went."""
    return replace(
        record,
        state=TaskState.SUCCEEDED,
        tries=(*record.tries, *report.tries),
        reason=done,
        started_s=record.started_s if report.started_s is None else report.started_s,
        ended_s=report.ended_s,
        trace=report.program,
    )


def _to_be_done(entry: PlanEntry, ask: ControlRequest) -> TaskRecord | str:
    """The task, if it is still to be done, else a sentence on why nobody need do it."""
    plan = ask.plan
    if entry.state not in (PlanState.READY, PlanState.RUNNING):
        return f"plan {plan} is {entry.state.value}; tasks are done of ready or running plans"
    if entry.cancelling:
        return f"plan {plan} is being cancelled"
    if ask.task is None:
        return "the request names no task"
    record = entry.records.get(ask.task)
    if record is None:
        known = nearest(list(entry.records), ask.task)
        return f"plan {plan} has no task {ask.task}; its tasks are {known}"
    if record.state is TaskState.SUCCEEDED:
        return f"task {ask.task} of plan {plan} is done already"
    if ask.task in entry.by_hand:
        return f"task {ask.task} of plan {plan} is {entry.by_hand[ask.task]} already"
    gone = not entry.is_wanted(record)
    if record.state in ENDED_TASKS or ask.task in entry.unwanted or gone:
        was = "is being cancelled" if ask.task in entry.unwanted else f"is {record.state.value}"
        was = f"is for goal {record.goal}, which it no longer has" if gone else was
        return (
            f"task {ask.task} of plan {plan} {was}: the plan goes on without it; say what is so "
            "now instead, with `robotctl world add`"
        )
    return record
