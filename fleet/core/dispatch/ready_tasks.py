"""The ready set: a waiting task is ordered once its turn has come and its robots are free."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.dispatch.free_robots import is_free
from fleet.core.model.preconditions import action_of, unmet_before
from fleet.core.model.skills import Action, Skills
from fleet.core.plan_entry import OUTSTANDING, PlanEntry, ReplanScope
from fleet.core.state import State
from fleet.core.updates import give_up, set_entry, set_record
from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState


def order_if_ready(
    state: State, plan: str, record: TaskRecord, skills: Skills, reservations: bool = True
) -> State:
    """Order a waiting task if nothing holds it back; replan if the world is not as it must be.

    See `is_free` for `reservations`.
    """
    entry = state.plans[plan]
    befores = (*record.after, *record.behind)
    if any(
        entry.records[before].state is not TaskState.SUCCEEDED
        for before in befores
        if before in entry.records
    ):
        return state
    action = action_of(record, skills)
    if action is None:
        reason = f"{record.task} cannot start: there is no skill {record.skill} any more"
        return give_up(state, entry, reason)
    if not all(is_free(state, robot, plan, reservations) for robot in action.participants):
        return state
    if _touches_unwanted_work(entry, action, skills):
        return state
    if (unmet := unmet_before(action, state.world(skills))) is not None:
        reason = f"{record.task} ({record.skill}) cannot start: {unmet}"
        return set_entry(state, entry.to_replan(ReplanScope.REPAIR, reason))
    ordered = replace(
        record,
        state=TaskState.ORDERED,
        attempt=record.attempt + 1,
        ordered_s=state.time_s if record.ordered_s is None else record.ordered_s,
        way_s=_way_s(state, action, skills),
    )
    return set_record(state, entry, ordered)


def _touches_unwanted_work(entry: PlanEntry, action: Action, skills: Skills) -> bool:
    """Whether a task that is being cancelled, and has not confirmed it, is about the same facts."""
    variables = action.variables
    for task in entry.unwanted:
        record = entry.records[task]
        if record.state in OUTSTANDING:
            other = action_of(record, skills)
            if other is None or variables & other.variables:
                return True
    return False


def _way_s(state: State, action: Action, skills: Skills) -> float | None:
    """The way to the task at its robot's top speed, s; `None` if nobody knows from where."""
    if action.skill.travel_to is None:
        return 0.0
    here = state.fact(AT, action.actor)
    if here is None or here.value not in state.places:
        return None
    return state.world(skills).way_s(action.actor, here.value, action.args[action.skill.travel_to])
