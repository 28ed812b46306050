"""The ready set: tasks whose turn has come and whose robots are free, ordered at once.

The dispatcher asks for each waiting task, plans by priority and tasks in the plan's order.
"""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.dispatch.while_replanning import waits_for_new_plan
from fleet.core.model.preconditions import action_of, unmet_before
from fleet.core.model.skills import Action
from fleet.core.plan_entry import OUTSTANDING, PlanEntry
from fleet.core.replan_reasons import ReplanScope
from fleet.core.state import State
from fleet.core.state_updates import conditions_of, give_up, open_goals, set_entry, set_record
from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState


def by_priority(state: State) -> list[str]:
    """The plans in the order in which their ready tasks are given robots."""

    def rank(plan: str) -> tuple[int, str]:
        goals = [state.goals[g] for g in state.plans[plan].plan.goals if g in state.goals]
        return -max((goal.priority for goal in goals), default=0), plan

    return sorted(state.plans, key=rank)


def order_if_ready(state: State, plan: str, record: TaskRecord, reservations: bool = True) -> State:
    """Order a waiting task if nothing holds it back; replan if the world is not as it must be.

    See `_is_free` for `reservations`.
    """
    entry = state.plans[plan]
    befores = (*record.after, *record.behind)
    if any(
        entry.records[before].state is not TaskState.SUCCEEDED
        for before in befores
        if before in entry.records
    ):
        return state
    action = action_of(record, state.skills)
    if action is None:
        reason = f"{record.task} cannot start: there is no skill {record.skill} any more"
        return give_up(state, entry, reason)
    if waits_for_new_plan(state, entry, record, action):
        return state
    if not all(_is_free(state, robot, plan, reservations) for robot in action.participants):
        return state
    if _touches_unwanted_work(state, action):
        return state
    if (unmet := unmet_before(action, state.world())) is not None:
        reason = f"{record.task} ({record.skill}) cannot start: {unmet}"
        goals, tasks = (record.goal,), (record.task,)
        entry = entry.to_replan(ReplanScope.REPAIR, reason, goals=goals, tasks=tasks)
        return set_entry(state, entry)
    serial = state.attempts_made + 1
    state = replace(state, attempts_made=serial)
    ordered = replace(
        record,
        state=TaskState.ORDERED,
        attempt=record.attempt + 1,
        # A plan of before lineages: its workers count attempts without numbers.
        serial=0 if entry.lineage is None else serial,
        ordered_s=state.time_s if record.ordered_s is None else record.ordered_s,
        way_s=_way_s(state, action),
    )
    if entry.job is not None:
        entry = replace(entry, given_out=entry.given_out.set(record.task, None))
    return set_record(state, entry, ordered)


def _touches_unwanted_work(state: State, action: Action) -> bool:
    """Whether a task that is being cancelled, and has not confirmed it, is about the same facts.

    That of a robot that is lost, or of a plan that is over, may be carried out as well.
    """
    variables = action.variables
    for entry in state.plans.values():
        for task in entry.unwanted:
            record = entry.records[task]
            if record.state in OUTSTANDING:
                other = action_of(record, state.skills)
                if other is None or variables & other.variables:
                    return True
    return False


def _way_s(state: State, action: Action) -> float | None:
    """The way to the task at its robot's top speed, s; `None` if nobody knows from where."""
    if action.skill.travel_to is None:
        return 0.0
    here = state.fact(AT, action.actor)
    if here is None or here.value not in state.places:
        return None
    return state.world().way_s(action.actor, here.value, action.args[action.skill.travel_to])


def _is_free(state: State, robot: str, plan: str, reservations: bool) -> bool:
    """Whether a robot is connected, and neither works now nor is reserved by another plan.

    A robot that carries what a plan wants brought somewhere is that plan's until it is delivered:
    between a pick and its place no other plan may have the hand. Without a load, a robot that has
    begun an actor's work stays reserved by that plan until it has nothing left to do there, unless
    `reservations` are not to count.
    """
    if not state.connected.get(robot):
        return False
    carries = _carries_for(state, robot, state.plans[plan])
    for entry in state.plans.values():
        begun: set[str] = set()
        unfinished: set[str] = set()
        for record in entry.records.values():
            if robot not in (record.robot, *record.args.values()):
                continue
            if record.state in OUTSTANDING:
                return False
            if record.robot == robot and record.state is TaskState.SUCCEEDED:
                begun.add(record.actor)
            elif record.robot == robot and record.state is TaskState.WAITING:
                unfinished.add(record.actor)
        if entry.plan.plan == plan or entry.ended or carries:
            continue
        if (reservations and begun & unfinished) or _carries_for(state, robot, entry):
            return False
    return True


def _carries_for(state: State, robot: str, entry: PlanEntry) -> bool:
    """Whether a robot has something with it that an open goal of the plan is about."""
    return any(
        (fact := state.fact(AT, subject)) is not None and fact.value == robot
        for condition in conditions_of(state, open_goals(state, entry))
        for subject in condition.subjects
    )
