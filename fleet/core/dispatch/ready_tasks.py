"""The ready set: tasks whose turn has come and whose robots are free, ordered at once.

The dispatcher asks when a task's predecessors are done, and when a robot may have become free.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from heapq import merge

from msgspec.structs import replace

from fleet.core.charging import is_worth_charging, lacks_charge
from fleet.core.closed_ways import kept_from
from fleet.core.dispatch.charging import send_to_charge
from fleet.core.dispatch.trajectory import in_order
from fleet.core.dispatch.while_replanning import stands_still
from fleet.core.holds import plan_paused
from fleet.core.model.durations import only_moves
from fleet.core.model.preconditions import action_of, first_broken, unmet_before
from fleet.core.model.skills import Action
from fleet.core.plan_entry import PlanEntry
from fleet.core.replan_reasons import ReplanScope
from fleet.core.state import State
from fleet.core.state_updates import (
    give_up,
    set_entry,
    set_given_out,
    set_record,
)
from fleet.core.waiting.reasons import holding_back
from fleet.core.waiting.robots import not_free
from keyexpr_schema.facts import AT, FactKey, Literal
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState

NEEDLESS_SINCE_LOGIC = 4
"""Since then, a robot is not sent to where the plan has brought it already."""


def by_priority(state: State, plans: Iterable[str]) -> list[str]:
    """Plans that have not ended, in the order in which their ready tasks are given robots."""
    active = state.index.active
    return sorted((plan for plan in plans if plan in active), key=lambda p: (-active[p], p))


def order_ready(state: State, plan: str, tasks: Iterable[str], robots: Iterable[str]) -> State:
    """Order of `tasks`, and of what is ready for `robots`, what can be, in the plan's order.

    Nothing else can have become ready: what a task waits for is its predecessors and its robots.
    """
    entry = state.plans[plan]
    position = entry.index.graph.position
    now = [state]

    def ready_for(robot: str) -> Iterator[tuple[int, str]]:
        for task in entry.index.ready.get(robot, ()):
            if any(not_free(now[0], robot, plan)):
                return
            yield position[task], task

    first = sorted((position[task], task) for task in tasks if task in entry.index.open)
    for _, task in merge(first, *(ready_for(robot) for robot in sorted(robots))):
        now[0] = order_if_ready(now[0], plan, task)
        if not may_order(now[0], now[0].plans[plan]):
            break
    return now[0]


def may_order(state: State, entry: PlanEntry) -> bool:
    """Whether tasks of the plan are given out now, if nothing else holds them back."""
    running = entry.state is PlanState.RUNNING and not entry.cancelling
    return (
        running and not stands_still(state, entry) and plan_paused(state, entry.plan.plan) is None
    )


def order_if_ready(state: State, plan: str, task: str, reservations: bool = True) -> State:
    """Order a waiting task if nothing holds it back; replan if the world is not as it must be.

    See `fleet.core.waiting.robots.not_free` for `reservations`.
    """
    entry = state.plans[plan]
    if entry.index.open.get(task) != 0:
        return state
    record = entry.records[task]
    action = action_of(record, state.skills)
    if action is None:
        reason = f"{record.task} cannot start: there is no skill {record.skill} any more"
        return give_up(state, entry, reason)
    if any(holding_back(state, entry, record, action, reservations)):
        return state
    world = state.world()
    unmet = kept_from(state, record, world) or unmet_before(action, world)
    if unmet is None and entry.plan.is_constrained:
        unmet = first_broken(action, entry.plan, in_order(state, entry), world)
    if unmet is not None:
        reason = f"{record.task} ({record.skill}) cannot start: {unmet}"
        goals, tasks = (record.goal,), (record.task,)
        entry = entry.to_replan(ReplanScope.REPAIR, reason, goals=goals, tasks=tasks)
        return set_entry(state, entry)
    if (short := lacks_charge(state, plan, action)) is not None:
        return _charged_first(state, entry, record, action.actor, short)
    if state.logic >= NEEDLESS_SINCE_LOGIC and _stands_there(state, entry, record, action):
        reason = f"{action.actor} stands there already"
        now_s = state.time_s
        done = replace(
            record,
            state=TaskState.SUCCEEDED,
            reason=reason,
            way_s=0.0,
            started_s=now_s,
            ended_s=now_s,
        )
        if entry.job is not None:
            state = set_given_out(state, entry, task)
        return set_record(state, state.plans[plan], done)
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
        state = set_given_out(state, entry, task)
    return set_record(state, state.plans[plan], ordered)


def _charged_first(
    state: State, entry: PlanEntry, record: TaskRecord, robot: str, short: str
) -> State:
    """Have a robot charge that has not enough for a task; where that would not help, or cannot be,
    somebody else has to do it."""
    if is_worth_charging(state, robot):
        return send_to_charge(state, robot)
    reason = f"{record.task} ({record.skill}) cannot start: {short}"
    goals, tasks = (record.goal,), (record.task,)
    return set_entry(state, entry.to_replan(ReplanScope.REPAIR, reason, goals=goals, tasks=tasks))


def _stands_there(state: State, entry: PlanEntry, record: TaskRecord, action: Action) -> bool:
    """Whether a drive need not be ordered: the robot says that it is there, and what it did just
    before in this plan was done there. Where it stood when the plan began, its worker sees better:
    it may be in a doorway.
    """
    if not only_moves(action.skill):
        return False
    place = action.args[str(action.skill.travel_to)]
    here = Literal(FactKey(AT, action.actor), place)
    fact = state.fact(AT, action.actor)
    if fact is None or (fact.value, fact.source) != (place, action.actor):
        return False
    for name in (*record.behind, *record.after):
        before = entry.records.get(name)
        if before is not None and before.state is TaskState.SUCCEEDED:
            done = action_of(before, state.skills)
            if done is not None and here in (*done.before, *done.after):
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
