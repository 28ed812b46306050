"""Planning jobs that have ended: the plan is taken over, or goes on as it was, or ends."""

from __future__ import annotations

from collections.abc import Sized

from msgspec.structs import replace

from fleet.core import events
from fleet.core.effects import status_of
from fleet.core.plan_entry import PlanEntry, PlanningJob, ReplanReason
from fleet.core.revision.reconcile import reconcile
from fleet.core.state import State
from fleet.core.state_updates import answer, give_up, mark_goals, set_entry, without_goal
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import Plan, PlanState
from keyexpr_schema.payloads.requests import Answer
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskState


def planning_succeeded(state: State, event: events.PlanningSucceeded) -> State:
    """Take over a finished plan, or show it where it was only asked to be seen."""
    if (preview := _preview_of(state, event.job)) is not None:
        return _show(state, preview, event)
    entry = state.plans.get(event.plan.plan)
    if entry is None or entry.job is None or entry.job.job != event.job:
        return state
    job = entry.job
    first = event.plan.revision == 1
    team = state.team()
    newer = _newer_reason(entry, job)
    if _as_it_was(entry, job, event):
        return set_entry(state, replace(entry, job=None, replan=newer, team=team))
    for goal, reason in event.left_out.items():
        state = mark_goals(state, (goal,), GoalState.FAILED, entry.plan.plan, reason)
    for goal, reason in event.postponed.items():
        state = mark_goals(state, (goal,), GoalState.WAITING, None, reason)
    event = replace(event, plan=_for_goals_of_now(state, entry, job, event))
    # What was given up meanwhile is cancelled: nothing can go on with it.
    under_way = frozenset(job.under_way) - set(entry.unwanted)
    revision = reconcile(entry, event, state.world(), under_way)
    added = (goal for goal in entry.plan.goals if goal not in job.goals)
    to = entry.state
    if first:
        to = PlanState.PROPOSED if state.policy.approval else PlanState.READY
    if to is PlanState.READY and entry.start:
        to = PlanState.RUNNING
    entry = replace(
        entry,
        plan=replace(revision.plan, goals=(*revision.plan.goals, *added)),
        outcome=event.outcome,
        state=to,
        records=entry.records.updated(revision.records),
        unwanted=tuple(dict.fromkeys([*entry.unwanted, *revision.unwanted])),
        change=None if first else revision.change,
        job=None,
        replan=newer,
        amendment=None,
        amendment_request=None,
        team=team,
        fruitless_replans=entry.fruitless_replans
        + (not first and not (event.repaired and job.reallocation)),
        reason=None,
        violations=(),
    )
    state = set_entry(state, entry)
    goal_state = GoalState.RUNNING if to is PlanState.RUNNING else GoalState.PLANNED
    state = mark_goals(state, event.plan.goals, goal_state, entry.plan.plan)
    return answer(state, job.request, True, _made_sentence(event), entry.plan.plan)


def _for_goals_of_now(
    state: State, entry: PlanEntry, job: PlanningJob, event: events.PlanningSucceeded
) -> Plan:
    """The plan without goals that were taken out of it while it was being made."""
    plan = replace(event.plan, autostart=entry.start)
    for goal in event.plan.goals:
        if goal in job.goals and goal not in entry.plan.goals:
            plan = without_goal(state, plan, goal)
    return plan


def _as_it_was(entry: PlanEntry, job: PlanningJob, event: events.PlanningSucceeded) -> bool:
    """Whether another allocation of what is left has turned out to be the one there is."""
    current = list(entry.current())
    return (
        event.repaired
        and job.reallocation
        and not event.left_out
        and not event.postponed
        and event.allocation.items() <= job.previous_allocation.items()
        and all(record.state not in (TaskState.FAILED, TaskState.CANCELLED) for record in current)
        and not any(record.task in entry.unwanted for record in current)
        and len(event.plan.tasks) == sum(record.state not in ENDED_TASKS for record in current)
    )


def _newer_reason(entry: PlanEntry, job: PlanningJob) -> ReplanReason | None:
    """What came up while the plan was being made is a reason to make it again."""
    return None if entry.replan == job.reason else entry.replan


def _made_sentence(event: events.PlanningSucceeded) -> str:
    plan = event.plan
    tasks, goals = _counted(plan.tasks, "task"), _counted(plan.goals, "goal")
    sentences = [f"plan {plan.plan} has {tasks} for {goals}"]
    if plan.making.fallback:
        sentences.append(plan.making.fallback)
    missing = {**event.left_out, **event.postponed}
    sentences += [f"goal {goal} is left out: {reason}" for goal, reason in missing.items()]
    return "; ".join(sentences)


def _counted(things: Sized, what: str) -> str:
    return f"{len(things)} {what}{'' if len(things) == 1 else 's'}"


def _preview_of(state: State, job: int) -> PlanningJob | None:
    return next((found for found in state.previews.values() if found.job == job), None)


def _show(state: State, job: PlanningJob, event: events.PlanningSucceeded) -> State:
    assert job.request is not None
    entry = PlanEntry(plan=event.plan, state=PlanState.READY, outcome=event.outcome)
    reply = Answer(
        request=job.request,
        accepted=True,
        sentence=f"a dry run: {_made_sentence(event)}",
        preview=event.plan,
        preview_status=status_of(entry),
    )
    return replace(
        state,
        previews=state.previews.without(job.request),
        answers=state.answers.set(job.request, reply),
    )


def planning_failed(state: State, event: events.PlanningFailed) -> State:
    """A job failed: a first plan is rejected, a running one goes on or is given up."""
    if (preview := _preview_of(state, event.job)) is not None:
        assert preview.request is not None
        state = replace(state, previews=state.previews.without(preview.request))
        return answer(state, preview.request, False, event.reason, violations=event.violations)
    entry = next(
        (b for b in state.plans.values() if b.job is not None and b.job.job == event.job), None
    )
    if entry is None or entry.job is None:
        return state
    request, newer = entry.job.request, _newer_reason(entry, entry.job)
    entry = replace(
        entry,
        job=None,
        violations=event.violations,
        outcome=replace(entry.outcome, planning_time_s=event.planning_time_s),
    )
    if entry.amendment is not None:
        # The plan as it was still stands; only the addition is refused.
        entry = replace(entry, amendment=None, amendment_request=None, replan=newer)
        state = set_entry(state, entry)
        sentence = f"the task was not added: {event.reason}"
        return answer(state, request, False, sentence, entry.plan.plan, event.violations)
    if entry.plan.revision == 1 and not entry.records:
        entry = replace(entry, state=PlanState.REJECTED, reason=event.reason)
        state = set_entry(state, entry)
        state = mark_goals(state, entry.plan.goals, GoalState.WAITING, None, event.reason)
        return answer(state, request, False, event.reason, entry.plan.plan, event.violations)
    to = GoalState.WAITING if event.postponed else GoalState.FAILED
    return give_up(state, entry, event.reason, to)
