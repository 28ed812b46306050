"""Planning jobs: when a plan is made again, and what becomes of a job that has ended."""

from __future__ import annotations

from collections.abc import Sized

from msgspec.structs import replace

from fleet.core import events
from fleet.core.effects import status_of
from fleet.core.handlers.goals import mark_goals
from fleet.core.model.preconditions import Skills
from fleet.core.plan_entry import answer, give_up, next_task, open_goals, set_entry
from fleet.core.revision.reconcile import revise
from fleet.core.revision.residual_plan import actors_in_order, begun_actors, remaining_plan
from fleet.core.state import PlanEntry, PlanningJob, State, put, without
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import Answer
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskState

MAX_REPLANS = 12
"""After this many new revisions for each of its open goals, without one reached, a plan is given
up: the world does not go along with it."""


def plan_again(state: State, entry: PlanEntry) -> State:
    """Start the planning job of the next revision, from the facts as they are now.

    What is under way goes on meanwhile; nothing new is ordered until the job has ended.
    """
    if entry.replans >= MAX_REPLANS * max(1, len(open_goals(state, entry))):
        return give_up(
            state,
            entry,
            f"given up after {entry.replans} new plans; the last: {entry.replan_reason}",
        )
    revision = entry.plan.revision + 1
    job = PlanningJob(
        job=state.jobs + 1,
        plan=entry.plan.plan,
        revision=revision,
        goals=entry.plan.goals,
        strategy=entry.plan.strategy,
        planner=entry.planner,
        allocator=entry.plan.allocator,
        first_task=next_task(entry) + (entry.amendment is not None),
        partial=True,
        # What is being cancelled is not what a new plan could go on with, though it wants the same.
        running=tuple(r.task for r in entry.outstanding() if r.task not in entry.dropping),
        reason=entry.replan_reason,
        request=entry.amendment_request,
    )
    if entry.amendment is not None:
        job = replace(job, proposal=remaining_plan(entry, revision, addition=entry.amendment))
    elif _may_be_mended(entry):
        gone = {robot for robot in entry.allocation.values() if not state.ready(robot)}
        job = replace(
            job,
            remaining=remaining_plan(entry, revision, gone),
            outside=entry.replan_reason == entry.outside_reason,
            home=entry.allocation,
            sequence=actors_in_order(entry),
            begun=tuple(begun_actors(entry, gone)),
        )
    return set_entry(replace(state, jobs=job.job), replace(entry, job=job))


def _may_be_mended(entry: PlanEntry) -> bool:
    """Whether what is left of a plan may go on. A find ends a search, which takes a whole plan."""
    if entry.replan_reason == entry.outside_reason:
        return True
    return entry.replan_reason != entry.anew_reason and not entry.plan.seeks


def planning_succeeded(state: State, event: events.PlanningSucceeded, skills: Skills) -> State:
    """Take over a finished plan, or show it where it was only asked to be seen."""
    if (preview := _preview_of(state, event.job)) is not None:
        return _show(state, preview, event)
    entry = state.plans.get(event.plan.plan)
    if entry is None or entry.job is None or entry.job.job != event.job:
        return state
    job = entry.job
    first = event.plan.revision == 1
    team = state.team()
    if _as_it_was(entry, job, event):
        entry = replace(entry, job=None, replan_reason=_new_reason(entry, job), team=team)
        return set_entry(state, entry)
    for goal, reason in event.left_out.items():
        state = mark_goals(state, (goal,), GoalState.FAILED, entry.plan.plan, reason)
    event = replace(event, plan=replace(event.plan, autostart=entry.start))
    revision = revise(entry, event, state.world(skills), frozenset(job.running))
    to = entry.state
    if first:
        to = PlanState.PROPOSED if state.policy.approval else PlanState.READY
    if to is PlanState.READY and entry.start:
        to = PlanState.RUNNING
    entry = replace(
        _with_outcome(entry, event),
        plan=revision.plan,
        state=to,
        records=revision.records,
        dropping=tuple(dict.fromkeys([*entry.dropping, *revision.dropping])),
        change=None if first else revision.change,
        job=None,
        replan_reason=_new_reason(entry, job),
        amendment=None,
        amendment_request=None,
        team=team,
        replans=entry.replans + (not first and not (event.mended and job.outside)),
        reason=None,
        violations=(),
    )
    state = set_entry(state, entry)
    goal_state = GoalState.RUNNING if to is PlanState.RUNNING else GoalState.PLANNED
    state = mark_goals(state, entry.plan.goals, goal_state, entry.plan.plan)
    return answer(state, job.request, True, _made_sentence(event), entry.plan.plan)


def _as_it_was(entry: PlanEntry, job: PlanningJob, event: events.PlanningSucceeded) -> bool:
    """Whether another allocation of what is left has turned out to be the one there is."""
    current = list(entry.current())
    return (
        event.mended
        and job.outside
        and not event.left_out
        and event.allocation.items() <= job.home.items()
        and all(record.state not in (TaskState.FAILED, TaskState.CANCELLED) for record in current)
        and len(event.plan.tasks) == sum(record.state not in ENDED_TASKS for record in current)
    )


def _new_reason(entry: PlanEntry, job: PlanningJob) -> str | None:
    """What came up while the plan was being made is a reason to make it again."""
    return None if entry.replan_reason == job.reason else entry.replan_reason


def _with_outcome(entry: PlanEntry, event: events.PlanningSucceeded) -> PlanEntry:
    """The entry with what a job came to: the plan, its allocation, and what is predicted of it."""
    return replace(
        entry,
        plan=event.plan,
        allocation=event.allocation,
        sequence=event.sequence,
        makespan_s=event.makespan_s,
        lower_bound_s=event.lower_bound_s,
        notes=event.notes,
        planning_time_s=event.planning_time_s,
    )


def _made_sentence(event: events.PlanningSucceeded) -> str:
    plan = event.plan
    tasks, goals = _counted(plan.tasks, "task"), _counted(plan.goals, "goal")
    told = [f"plan {plan.plan} has {tasks} for {goals}"]
    if plan.making.fallback:
        told.append(plan.making.fallback)
    told += [f"goal {goal} is left out: {reason}" for goal, reason in event.left_out.items()]
    return "; ".join(told)


def _counted(things: Sized, what: str) -> str:
    return f"{len(things)} {what}{'' if len(things) == 1 else 's'}"


def _preview_of(state: State, job: int) -> PlanningJob | None:
    return next((found for found in state.previews.values() if found.job == job), None)


def _show(state: State, job: PlanningJob, event: events.PlanningSucceeded) -> State:
    assert job.request is not None
    entry = _with_outcome(PlanEntry(plan=event.plan, state=PlanState.READY), event)
    reply = Answer(
        request=job.request,
        accepted=True,
        sentence=f"a dry run: {_made_sentence(event)}",
        preview=event.plan,
        preview_status=status_of(entry),
    )
    return replace(
        state,
        previews=without(state.previews, job.request),
        answers=put(state.answers, job.request, reply),
    )


def planning_failed(state: State, event: events.PlanningFailed) -> State:
    """A job failed: a first plan is rejected, a running one goes on or is given up."""
    if (preview := _preview_of(state, event.job)) is not None:
        assert preview.request is not None
        state = replace(state, previews=without(state.previews, preview.request))
        return answer(state, preview.request, False, event.reason, violations=event.violations)
    entry = next(
        (b for b in state.plans.values() if b.job is not None and b.job.job == event.job), None
    )
    if entry is None or entry.job is None:
        return state
    request = entry.job.request
    entry = replace(
        entry,
        job=None,
        violations=event.violations,
        planning_time_s=event.planning_time_s,
    )
    if entry.amendment is not None:
        # The plan as it was still stands; only the addition is refused.
        entry = replace(entry, amendment=None, amendment_request=None, replan_reason=None)
        state = set_entry(state, entry)
        sentence = f"the task was not added: {event.reason}"
        return answer(state, request, False, sentence, entry.plan.plan, event.violations)
    if entry.plan.revision == 1 and not entry.records:
        entry = replace(entry, state=PlanState.REJECTED, reason=event.reason)
        state = set_entry(state, entry)
        state = mark_goals(state, entry.plan.goals, GoalState.WAITING, None, event.reason)
        return answer(state, request, False, event.reason, entry.plan.plan, event.violations)
    return give_up(state, entry, event.reason)
