"""When a plan is to be made again: the planning job of its next revision."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.plan_entry import PlanEntry, PlanningJob, ReplanReason, ReplanScope
from fleet.core.revision.residual_plan import actors_in_order, begun_actors, residual_plan
from fleet.core.state import State
from fleet.core.state_updates import give_up, open_goals, set_entry

MAX_REPLANS = 12
"""After this many new revisions for each of its open goals, without one reached, a plan is given
up: the world does not go along with it."""


def start_replanning(state: State, entry: PlanEntry) -> State:
    """Start the planning job of the next revision, from the facts as they are now.

    What is under way goes on meanwhile; nothing new is ordered until the job has ended.
    """
    reason, tried = entry.replan, entry.fruitless_replans
    assert reason is not None
    if tried >= MAX_REPLANS * max(1, len(open_goals(state, entry))):
        sentence = f"given up after {tried} new plans; the last: {reason.sentence}"
        return give_up(state, entry, sentence)
    revision = entry.plan.revision + 1
    job = replace(
        PlanningJob.of(state.jobs + 1, replace(entry.plan, revision=revision), entry.planner),
        first_task=entry.next_task_number + (entry.amendment is not None),
        partial=True,
        # What is being cancelled is not what a new plan could go on with, though it wants the same.
        under_way=tuple(r.task for r in entry.outstanding() if r.task not in entry.unwanted),
        reason=reason,
        request=entry.amendment_request,
    )
    if entry.amendment is not None:
        job = replace(job, proposal=residual_plan(entry, revision, addition=entry.amendment))
    elif _residual_plan_may_go_on(entry, reason):
        allocation = entry.outcome.allocation
        gone = {robot for robot in allocation.values() if not state.ready(robot)}
        job = replace(
            job,
            residual=residual_plan(entry, revision, gone),
            previous_allocation=allocation,
            actor_order=actors_in_order(entry),
            begun_actors=tuple(begun_actors(entry, gone)),
        )
    return set_entry(replace(state, jobs=job.job), replace(entry, job=job))


def _residual_plan_may_go_on(entry: PlanEntry, reason: ReplanReason) -> bool:
    """A find ends a search, which takes a whole plan."""
    if reason.scope is ReplanScope.REPAIR:
        return not entry.plan.seeks
    return reason.scope is ReplanScope.REALLOCATE
