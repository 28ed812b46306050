"""Planning jobs: when a plan is made again, and what becomes of a job that has ended."""

from __future__ import annotations

from collections.abc import Sized

from msgspec.structs import replace

from fleet.core import events
from fleet.core.effects import status_of
from fleet.core.handlers.goals import mark_goals
from fleet.core.model.preconditions import Skills
from fleet.core.plan_entry import answer, give_up, next_task, open_goals, set_book
from fleet.core.revision.reconcile import revise
from fleet.core.revision.residual_plan import actors_in_order, begun_actors, remaining_plan
from fleet.core.state import Job, PlanBook, State, put, without
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import Answer
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskState

MAX_REPLANS = 12
"""After this many new revisions for each of its open goals, without one reached, a plan is given
up: the world does not go along with it."""


def plan_again(state: State, book: PlanBook) -> State:
    """Start the planning job of the next revision, from the facts as they are now.

    What is under way goes on meanwhile; nothing new is ordered until the job has ended.
    """
    if book.replans >= MAX_REPLANS * max(1, len(open_goals(state, book))):
        return give_up(
            state, book, f"given up after {book.replans} new plans; the last: {book.replan_reason}"
        )
    revision = book.plan.revision + 1
    job = Job(
        job=state.jobs + 1,
        plan=book.plan.plan,
        revision=revision,
        goals=book.plan.goals,
        strategy=book.plan.strategy,
        planner=book.planner,
        allocator=book.plan.allocator,
        first_task=next_task(book) + (book.amendment is not None),
        partial=True,
        # What is being cancelled is not what a new plan could go on with, though it wants the same.
        running=tuple(r.task for r in book.outstanding() if r.task not in book.dropping),
        reason=book.replan_reason,
        request=book.amendment_request,
    )
    if book.amendment is not None:
        job = replace(job, proposal=remaining_plan(book, revision, addition=book.amendment))
    elif _may_be_mended(book):
        gone = {robot for robot in book.allocation.values() if not state.ready(robot)}
        job = replace(
            job,
            remaining=remaining_plan(book, revision, gone),
            outside=book.replan_reason == book.outside_reason,
            home=book.allocation,
            sequence=actors_in_order(book),
            begun=tuple(begun_actors(book, gone)),
        )
    return set_book(replace(state, jobs=job.job), replace(book, job=job))


def _may_be_mended(book: PlanBook) -> bool:
    """Whether what is left of a plan may go on. A find ends a search, which takes a whole plan."""
    if book.replan_reason == book.outside_reason:
        return True
    return book.replan_reason != book.anew_reason and not book.plan.seeks


def planning_succeeded(state: State, event: events.PlanningSucceeded, skills: Skills) -> State:
    """Take over a finished plan, or show it where it was only asked to be seen."""
    if (preview := _preview_of(state, event.job)) is not None:
        return _show(state, preview, event)
    book = state.plans.get(event.plan.plan)
    if book is None or book.job is None or book.job.job != event.job:
        return state
    job = book.job
    first = event.plan.revision == 1
    team = state.team()
    if _as_it_was(book, job, event):
        book = replace(book, job=None, replan_reason=_new_reason(book, job), team=team)
        return set_book(state, book)
    for goal, reason in event.left_out.items():
        state = mark_goals(state, (goal,), GoalState.FAILED, book.plan.plan, reason)
    event = replace(event, plan=replace(event.plan, autostart=book.start))
    revision = revise(book, event, state.world(skills), frozenset(job.running))
    to = book.state
    if first:
        to = PlanState.PROPOSED if state.policy.approval else PlanState.READY
    if to is PlanState.READY and book.start:
        to = PlanState.RUNNING
    book = replace(
        _with_outcome(book, event),
        plan=revision.plan,
        state=to,
        records=revision.records,
        dropping=tuple(dict.fromkeys([*book.dropping, *revision.dropping])),
        change=None if first else revision.change,
        job=None,
        replan_reason=_new_reason(book, job),
        amendment=None,
        amendment_request=None,
        team=team,
        replans=book.replans + (not first and not (event.mended and job.outside)),
        reason=None,
        violations=(),
    )
    state = set_book(state, book)
    goal_state = GoalState.RUNNING if to is PlanState.RUNNING else GoalState.PLANNED
    state = mark_goals(state, book.plan.goals, goal_state, book.plan.plan)
    return answer(state, job.request, True, _made_sentence(event), book.plan.plan)


def _as_it_was(book: PlanBook, job: Job, event: events.PlanningSucceeded) -> bool:
    """Whether another allocation of what is left has turned out to be the one there is."""
    current = list(book.current())
    return (
        event.mended
        and job.outside
        and not event.left_out
        and event.allocation.items() <= job.home.items()
        and all(record.state not in (TaskState.FAILED, TaskState.CANCELLED) for record in current)
        and len(event.plan.tasks) == sum(record.state not in ENDED_TASKS for record in current)
    )


def _new_reason(book: PlanBook, job: Job) -> str | None:
    """What came up while the plan was being made is a reason to make it again."""
    return None if book.replan_reason == job.reason else book.replan_reason


def _with_outcome(book: PlanBook, event: events.PlanningSucceeded) -> PlanBook:
    """The book with what a job came to: the plan, its allocation, and what is predicted of it."""
    return replace(
        book,
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


def _preview_of(state: State, job: int) -> Job | None:
    return next((found for found in state.previews.values() if found.job == job), None)


def _show(state: State, job: Job, event: events.PlanningSucceeded) -> State:
    assert job.request is not None
    book = _with_outcome(PlanBook(plan=event.plan, state=PlanState.READY), event)
    reply = Answer(
        request=job.request,
        accepted=True,
        sentence=f"a dry run: {_made_sentence(event)}",
        preview=event.plan,
        preview_status=status_of(book),
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
    book = next(
        (b for b in state.plans.values() if b.job is not None and b.job.job == event.job), None
    )
    if book is None or book.job is None:
        return state
    request = book.job.request
    book = replace(
        book,
        job=None,
        violations=event.violations,
        planning_time_s=event.planning_time_s,
    )
    if book.amendment is not None:
        # The plan as it was still stands; only the addition is refused.
        book = replace(book, amendment=None, amendment_request=None, replan_reason=None)
        state = set_book(state, book)
        sentence = f"the task was not added: {event.reason}"
        return answer(state, request, False, sentence, book.plan.plan, event.violations)
    if book.plan.revision == 1 and not book.records:
        book = replace(book, state=PlanState.REJECTED, reason=event.reason)
        state = set_book(state, book)
        state = mark_goals(state, book.plan.goals, GoalState.WAITING, None, event.reason)
        return answer(state, request, False, event.reason, book.plan.plan, event.violations)
    return give_up(state, book, event.reason)
