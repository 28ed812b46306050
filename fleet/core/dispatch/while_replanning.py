"""Which tasks are given out while their plan is made again.

Planning takes seconds, and a fleet that stands still for each goal that comes up gets nowhere. So a
task that no reason touches is ordered at once. The new plan is made of the facts from before that;
when it comes, `fleet.core.revision.reconcile` finds in it what was given out meanwhile. If it does
without, it was made for another world than it would begin in: it is discarded and made again, and
each time less is given out meanwhile.
"""

from __future__ import annotations

from fleet.core.model.preconditions import variables_of
from fleet.core.model.skills import Action
from fleet.core.plan_entry import PlanEntry
from fleet.core.replan_reasons import ReplanReason
from fleet.core.state import State
from keyexpr_schema.facts import FactKey
from keyexpr_schema.payloads.tasks import TaskRecord


def stands_still(state: State, entry: PlanEntry) -> bool:
    """Whether nothing of a plan is to be ordered, whatever it is."""
    return not state.plans_while_acting and (entry.job is not None or entry.replan is not None)


def waits_for_new_plan(state: State, entry: PlanEntry, record: TaskRecord, action: Action) -> bool:
    """Whether a task of a plan that is made again is not to be ordered before that is done."""
    reasons = entry.open_reasons
    if not reasons and entry.job is None:
        return False
    if stands_still(state, entry) or not entry.is_wanted(record):
        return True
    variables = variables_of(action, state.world()) if reasons else frozenset()
    if any(_touches(reason, record, action, variables) for reason in reasons):
        return True
    if entry.job is None or (entry.discarded == 0 and _keeps_actors(entry)):
        return False
    return entry.discarded > 1 or not _has_begun(state, entry, record)


def _touches(
    reason: ReplanReason, record: TaskRecord, action: Action, variables: frozenset[FactKey]
) -> bool:
    return (
        reason.whole
        or record.goal in reason.goals
        or record.task in reason.tasks
        or not set(reason.robots).isdisjoint(action.participants)
        or not set(reason.variables).isdisjoint(variables)
    )


def _keeps_actors(entry: PlanEntry) -> bool:
    """Whether the present job goes on with what is left of the plan, so that it is likely to leave
    an actor that begins meanwhile with its robot."""
    job = entry.job
    return job is not None and (job.residual is not None or job.proposal is not None)


def _has_begun(state: State, entry: PlanEntry, record: TaskRecord) -> bool:
    """Whether the task goes on with what its robot has begun."""
    if record.robot is not None and (record.robot, record.actor) in entry.index.begun:
        return True
    return any(
        plan == record.plan and entry.records[task].actor == record.actor
        for plan, task in state.index.work.get(record.robot or "", ())
    )
