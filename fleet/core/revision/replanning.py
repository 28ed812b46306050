"""When a plan is to be made again: the planning job of its next revision."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.plan_entry import PlanEntry, PlanningJob
from fleet.core.replan_reasons import ReplanReason, ReplanScope, TaskAdded
from fleet.core.revision.residual_plan import (
    actors_in_order,
    begun_actors,
    charging_between,
    residual_plan,
)
from fleet.core.state import State
from fleet.core.state_updates import (
    answer,
    give_up,
    open_goals,
    set_entry,
)
from fleet.core.table import Table
from keyexpr_schema.payloads.tasks import TaskState

MAX_REPLANS = 12
"""After this many new revisions for each of its open goals, without one reached, a plan is given
up: the world does not go along with it."""


def start_replanning(state: State, entry: PlanEntry) -> State:
    """Start the planning job of the next revision, from the facts as they are now.

    It takes up every reason and wish there is; but a task is added once nothing else is open, and
    alone, so that it is refused for what speaks against it and for nothing else.
    """
    tried = entry.fruitless_replans
    if entry.reasons and tried >= MAX_REPLANS * max(1, len(open_goals(state, entry))):
        last = max(entry.reasons, key=lambda reason: reason.number).sentence
        return give_up(state, entry, f"given up after {tried} new plans; the last: {last}")
    wishes = tuple(wish for wish in entry.wishes if not isinstance(wish, TaskAdded))
    if entry.reasons or wishes:
        reasons = (*entry.reasons, *(wish.reason for wish in wishes))
        job = _replanning_job(state, entry, reasons)
        goals = dict.fromkeys([*entry.plan.goals, *(g for wish in wishes for g in wish.goals)])
        job = replace(job, goals=tuple(goal for goal in goals if goal in state.goals))
        if _residual_plan_may_go_on(entry, reasons):
            job = _with_residual_plan(state, entry, job)
    else:
        (wish, *_) = (wish for wish in entry.wishes if isinstance(wish, TaskAdded))
        if (over := _never_done(entry, wish)) is not None:
            sentence = f"{wish.refusal}: {over} is {entry.records[over].state.value}"
            rest = replace(entry, wishes=tuple(w for w in entry.wishes if w is not wish))
            state = answer(set_entry(state, rest), wish.request, False, sentence, entry.plan.plan)
            return state if rest.replan is None else start_replanning(state, rest)
        job = _replanning_job(state, entry, (wish.reason,))
        task = wish.task(entry.next_task_number)
        proposal = residual_plan(
            entry,
            job.revision,
            addition=task,
            without=charging_between(entry, state.skills),
        )
        if wish.robot is not None:
            proposal = replace(proposal, pins={**proposal.pins, task.actor: wish.robot})
        job = replace(job, first_task=job.first_task + 1, proposal=proposal)
    return set_entry(replace(state, jobs=job.job), replace(entry, job=job, given_out=Table()))


def _replanning_job(
    state: State, entry: PlanEntry, reasons: tuple[ReplanReason, ...]
) -> PlanningJob:
    plan = replace(entry.plan, revision=entry.plan.revision + 1)
    return replace(
        PlanningJob.of(state.jobs + 1, plan, entry.planner),
        first_task=entry.next_task_number,
        team_number=state.team_number,
        partial=True,
        # What is being cancelled is not what a new plan could go on with, though it wants the same.
        under_way=tuple(r.task for r in entry.outstanding() if r.task not in entry.unwanted),
        reason=max(reasons, key=lambda reason: (reason.scope.strength, reason.number)),
        takes_up=tuple(reason.number for reason in reasons),
    )


def _residual_plan_may_go_on(entry: PlanEntry, reasons: tuple[ReplanReason, ...]) -> bool:
    """A find ends a search, which takes a whole plan."""
    scopes = {reason.scope for reason in reasons}
    if ReplanScope.ANEW in scopes:
        return False
    return not (ReplanScope.REPAIR in scopes and entry.plan.seeks)


def _with_residual_plan(state: State, entry: PlanEntry, job: PlanningJob) -> PlanningJob:
    allocation = entry.outcome.allocation
    gone = {robot for robot in allocation.values() if not state.ready(robot)}
    return replace(
        job,
        residual=residual_plan(
            entry, job.revision, gone, without=charging_between(entry, state.skills)
        ),
        previous_allocation=allocation,
        actor_order=actors_in_order(entry),
        begun_actors=tuple(begun_actors(entry, gone)),
    )


def _never_done(entry: PlanEntry, wish: TaskAdded) -> str | None:
    """A task that the wished one is to wait for, and that will never succeed."""
    for task in wish.after:
        if entry.records[task].state in (TaskState.FAILED, TaskState.CANCELLED):
            return task
    return None
