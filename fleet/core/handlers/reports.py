"""Workers' reports: what they mean for a plan's tasks."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.belief_updates import (
    LET_GO_SINCE_LOGIC,
    as_written,
    believe,
    believe_effects,
    conclude,
)
from fleet.core.closed_ways import kept_from
from fleet.core.dispatch.put_downs import note_what_was_left
from fleet.core.dispatch.replan_triggers import react_to_fact
from fleet.core.effects import PLANNER_SOURCE
from fleet.core.handlers.by_hand import left_off
from fleet.core.handlers.robots import run_ended
from fleet.core.indexes.plan_index import OUTSTANDING
from fleet.core.indexes.touches import Part, Touch
from fleet.core.model.durations import learn
from fleet.core.model.preconditions import action_of, effects_hold, unmet_before
from fleet.core.model.skills import Action
from fleet.core.model.world import Hopeless
from fleet.core.plan_entry import PlanEntry
from fleet.core.replan_reasons import ReplanScope
from fleet.core.state import State
from fleet.core.state_updates import (
    give_up,
    mark_goals,
    open_goals,
    set_record,
    touch,
    without_goal,
)
from keyexpr_schema.facts import AT, HOLDING, FactKey
from keyexpr_schema.payloads.goals import Condition, GoalState
from keyexpr_schema.payloads.system import LARGEST_EPOCH, LARGEST_OVERTAKEN
from keyexpr_schema.payloads.tasks import FINAL_REPORTS, Report, ReportState, TaskRecord, TaskState
from keyexpr_schema.payloads.world import Fact

BOUNDED_SINCE_LOGIC = 9
"""Before, a planner took the epoch above any that counts, and there was one that has none above."""
LEAVING_OFF_TELLS_SINCE_LOGIC = 7
"""Before, that was found out when the next task was to be ordered that needs it otherwise."""
MAX_FAILURES = 6
"""After so many failed tasks a goal is given up, and the plan goes on without it."""
MAX_ATTEMPTS = 3
"""Orders given for one task to one robot; each order has the worker's own tries inside."""


def report_received(state: State, event: events.ReportReceived) -> State:
    """A report of an attempt that is not current, or of another planner's, only brings facts.

    What a worker says when it ends comes before its token goes, and it gets no order in between.
    """
    report = event.report
    entry = state.plans.get(report.plan)
    gone = entry is not None and (entry.ended or report.task in entry.unwanted)
    if report.leaving:
        state = run_ended(state, report.robot, report.incarnation)
    state = _received(state, report)
    if entry is None or not gone or report.state not in FINAL_REPORTS:
        return state
    record = entry.records.get(report.task)
    return state if record is None else note_what_was_left(state, record)


def _received(state: State, report: Report) -> State:
    before = state
    # What was put on its key before was heard from there, and somebody may have spoken since.
    for fact in () if report.told and state.receipt else report.facts:
        state = believe(state, fact)
    outdated = _outdated_by_hand(state, report)
    for fact in outdated:
        if state.facts.get(fact.key) == fact:
            state = conclude(state, replace(fact, value=None))
    entry = state.plans.get(report.plan)
    record = entry.records.get(report.task) if entry else None
    if (
        entry is None
        or record is None
        or report.planner not in (None, entry.lineage)
        or record.state not in OUTSTANDING
        or (report.robot, report.attempt) != (record.robot, record.attempt)
    ):
        return state
    overtaken = LARGEST_OVERTAKEN if state.logic >= BOUNDED_SINCE_LOGIC else LARGEST_EPOCH
    of_another_epoch = report.state is ReportState.REFUSED and (
        report.epoch < report.fence <= overtaken
    )
    if report.state in FINAL_REPORTS and not of_another_epoch and record.task in entry.by_hand:
        record = left_off(record, report, entry.by_hand[record.task])
        return _told(set_record(state, entry, record), report, before)
    if report.state is not ReportState.STARTED and record.task in entry.halting:
        halting = tuple(task for task in entry.halting if task != record.task)
        entry = replace(entry, halting=halting)
        wanted = not (entry.ended or entry.cancelling or record.task in entry.unwanted)
        if report.state is ReportState.CANCELLED and wanted:
            return set_record(state, entry, _again(record, report))
    match report.state:
        case ReportState.STARTED:
            if record.state is TaskState.RUNNING:
                return state
            record = replace(record, state=TaskState.RUNNING, started_s=report.started_s)
            return set_record(state, entry, record)
        case ReportState.SUCCEEDED:
            return _succeeded(state, entry, record, report, before, outdated)
        case ReportState.CANCELLED:
            record = _ended(record, report, TaskState.CANCELLED)
            return _told(set_record(state, entry, record), report, before)
        case ReportState.FAILED:
            return _failed(state, entry, record, report)
        case ReportState.INTERRUPTED:
            return _interrupted(state, entry, record, report)
        case ReportState.REFUSED if of_another_epoch:
            return state  # of this planner's epoch, not of the attempt: it is ordered with a higher
        case ReportState.REFUSED:
            if entry.ended or record.task in entry.unwanted:
                return set_record(state, entry, _ended(record, report, TaskState.CANCELLED))
            if report.retryable and record.attempt < MAX_ATTEMPTS:
                return set_record(state, entry, _again(record, report))
            return _failed(state, entry, record, report)


def _outdated_by_hand(state: State, report: Report) -> tuple[Fact, ...]:
    """Of what a report says to be with its robot, that which its hand no longer held when it was
    looked at last. What lies in its basket is said to be with the robot as late as that."""
    if state.logic < LET_GO_SINCE_LOGIC:
        return ()
    robot = report.robot
    hand = next((fact for fact in report.facts if fact.key == FactKey(HOLDING, robot)), None)
    return tuple(
        fact
        for fact in report.facts
        if hand is not None
        and (fact.relation, fact.value) == (AT, robot)
        and fact.subject != hand.value
        and fact.time_s < hand.time_s
    )


def _told(state: State, report: Report, before: State) -> State:
    """What a robot says that has left something off may be against what goes on without that."""
    if state.logic < LEAVING_OFF_TELLS_SINCE_LOGIC:
        return state
    for said in report.facts:
        known = as_written(state, said).key
        fact, was = state.facts.get(known), before.facts.get(known)
        if fact is not None and fact is not was:
            said_again = was is not None and was.value == fact.value
            state = react_to_fact(state, fact, said_again)
    return state


def _ended(record: TaskRecord, report: Report, to: TaskState) -> TaskRecord:
    return replace(
        record,
        state=to,
        tries=(*record.tries, *report.tries),
        reason=report.reason,
        started_s=record.started_s if report.started_s is None else report.started_s,
        ended_s=report.ended_s,
        trace=report.program,
    )


def _again(record: TaskRecord, report: Report) -> TaskRecord:
    return replace(
        record,
        state=TaskState.WAITING,
        tries=(*record.tries, *report.tries),
        reason=report.reason,
        trace=report.program,
    )


def _succeeded(
    state: State,
    entry: PlanEntry,
    record: TaskRecord,
    report: Report,
    before: State,
    outdated: tuple[Fact, ...],
) -> State:
    """`before` is the state without what the report itself says: effects depend on that. Of what it
    says `outdated` does not hold."""
    reported = {as_written(state, fact).key for fact in report.facts if fact not in outdated}
    action = action_of(record, state.skills)
    state = _learned(state, record, report, action)
    if action is not None:
        state, _ = believe_effects(
            state,
            action,
            before.world(),
            source=PLANNER_SOURCE,
            time_s=report.ended_s or state.time_s,
            of_program=record.program is not None,
            reported=reported,
        )
    if (unmet := _not_as_wanted(state, record)) is not None:
        return _failed(state, entry, record, replace(report, reason=f"{unmet} does not hold"))
    state = set_record(state, entry, _ended(record, report, TaskState.SUCCEEDED))
    if record.task in entry.unwanted:
        entry = state.plans[entry.plan.plan]
        if (again := _wanted_again(entry, record)) is not None:
            state = set_record(state, entry, again)
    return state


def _not_as_wanted(state: State, record: TaskRecord) -> Condition | None:
    """What a sentence for a robot wanted, and its program has not brought about."""
    stages = () if record.program is None else record.program.stages
    world = state.world()
    return next((c for c in (stages[-1] if stages else ()) if not world.holds(c)), None)


def _wanted_again(entry: PlanEntry, done: TaskRecord) -> TaskRecord | None:
    """What was done after it had been given up need not be done again, if it is still wanted."""
    for record in entry.current():
        if (record.skill, record.args) == (done.skill, done.args) and not entry.index.open.get(
            record.task, 1
        ):
            reason = f"{done.robot} had done it as {done.task}"
            return replace(record, state=TaskState.SUCCEEDED, reason=reason)
    return None


def _learned(state: State, record: TaskRecord, report: Report, action: Action | None) -> State:
    """Take the attempt's duration into account, all of its tries included."""
    spec = state.robots.get(report.robot)
    if (
        spec is None
        or action is None
        or record.program is not None
        or record.way_s is None
        or report.started_s is None
        or report.ended_s is None
    ):
        return state
    took_s = report.ended_s - report.started_s
    known = learn(state.durations, spec.model, action.skill, took_s, record.way_s, report.ended_s)
    if known is state.durations:
        return state
    return touch(replace(state, durations=dict(known)), Touch(Part.DURATIONS, spec.model))


def _failed(state: State, entry: PlanEntry, record: TaskRecord, report: Report) -> State:
    record = _ended(record, report, TaskState.FAILED)
    if entry.ended or record.task in entry.unwanted:
        return set_record(state, entry, record)
    reason = f"{record.task} ({record.skill}) failed: {report.reason}"
    entry = _with_another_program(entry, record, report)
    entry = entry.to_replan(ReplanScope.REPAIR, reason, goals=(record.goal,))
    if kept_from(state, record, state.world()) is not None:
        return set_record(state, entry, record)  # it was closed meanwhile: nobody has failed
    if not report.retryable and (call := _hopeless(state, record, report)) is not None:
        entry = replace(entry, hopeless=(*entry.hopeless, call))
    if record.goal is not None and record.goal in entry.plan.goals:
        count = entry.failures.get(record.goal, 0) + 1
        entry = replace(entry, failures=entry.failures.set(record.goal, count))
        if count >= MAX_FAILURES:
            sentence = f"given up after {count} failed tasks; the last: {reason}"
            if open_goals(state, entry) == [record.goal]:
                entry = replace(entry, records=entry.records.set(record.task, record))
                return give_up(state, entry, sentence)
            state = mark_goals(state, (record.goal,), GoalState.FAILED, entry.plan.plan, sentence)
            entry = replace(entry, plan=without_goal(state, entry.plan, record.goal))
    return set_record(state, entry, record)


def _with_another_program(entry: PlanEntry, record: TaskRecord, report: Report) -> PlanEntry:
    """With the sentence as a wish again, if that could help: its program is then written anew, for
    what is known now."""
    wish = entry.added.get(record.actor)
    if record.program is None or wish is None or not report.retryable:
        return entry
    count = entry.failures.get(record.program.text, 0) + 1
    entry = replace(entry, failures=entry.failures.set(record.program.text, count))
    if count >= MAX_FAILURES:
        return entry
    return entry.wishing(replace(wish, request=None, after=(), robot=record.robot))


def _hopeless(state: State, record: TaskRecord, report: Report) -> Hopeless | None:
    """The task's call, if the facts still say that it could be done: what its worker knows better,
    a new plan has to know, or it would be the same again. Of a program, that call which failed."""
    reason = report.reason or "it did not say why"
    if record.program is not None:
        last = report.program.calls[-1:] if report.program is not None else ()
        skill = state.skills.get(last[0].name) if last else None
        if skill is None or last[0].reason is None:
            return None
        args = {name: str(value) for name, value in last[0].args.items()}
        args[skill.actor_parameter] = report.robot
        reason = last[0].reason
        action = skill.ground(args) if args.keys() == skill.parameters.keys() else None
    else:
        action = action_of(record, state.skills)
    if action is None or unmet_before(action, state.world()) is not None:
        return None
    name = record.skill if record.program is None else action.skill.name
    return Hopeless(name, dict(action.args), report.robot, reason)


def _interrupted(state: State, entry: PlanEntry, record: TaskRecord, report: Report) -> State:
    """A worker came back in the middle of an attempt: the world decides what it is worth."""
    if entry.ended or record.task in entry.unwanted:
        return set_record(state, entry, _ended(record, report, TaskState.CANCELLED))
    action = action_of(record, state.skills)
    if action is None:
        return _failed(state, entry, record, report)
    world = state.world()
    if effects_hold(action, world):
        record = _ended(record, report, TaskState.SUCCEEDED)
        return set_record(state, entry, replace(record, reason="found done after an interruption"))
    nobodys_fault = bool(report.stops) or report.lapsed
    again = record.attempt < MAX_ATTEMPTS or nobodys_fault
    if unmet_before(action, world) is None and again:
        return set_record(state, entry, _again(record, report))
    if nobodys_fault:  # nobody has failed, but this cannot go on: the facts say how it does
        reason = f"{record.task} ({record.skill}) was interrupted: {report.reason}"
        entry = entry.to_replan(ReplanScope.REPAIR, reason, goals=(record.goal,))
        return set_record(state, entry, _ended(record, report, TaskState.FAILED))
    return _failed(state, entry, record, report)
