"""Robots that do not come back: what they had to do is given to others, as far as it can be.

A robot whose worker is disconnected is *away*, and what it does waits for it. After
`Policy.lost_after_s`, or when it is unregistered, it is *lost*. What it was to do is allocated
again; what it has orders for is given up, which is no failure: it may be carried out all the same.
So those orders are cancelled, and the robot, the thing and the place stay reserved, until its
worker has spoken. Only for a robot that is unregistered and away nobody will.
"""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.indexes.plan_index import robots_of
from fleet.core.indexes.touches import Part, Touch
from fleet.core.plan_entry import PlanEntry
from fleet.core.replan_reasons import ReplanScope
from fleet.core.state import State
from fleet.core.state_updates import set_records, touch
from keyexpr_schema.payloads.tasks import TaskState

SINCE_LOGIC = 1
"""Before this logic of the core, what a lost robot had an order for had failed."""
DROPPED_SINCE_LOGIC = 8
"""Before, a plan that was being cancelled went on waiting for a lost robot's word on an order that
an earlier revision had dropped."""


def lost(state: State, robot: str) -> bool:
    """Whether a robot is not to be waited for."""
    since = state.gone_since.get(robot)
    return since is not None and (
        robot not in state.robots or state.monotonic_s - since >= state.policy.lost_after_s
    )


def all_lost(state: State, entry: PlanEntry) -> bool:
    """Whether nobody whose word a plan waits for is to be waited for."""
    robots = (record.robot for record in entry.outstanding())
    return all(robot is not None and lost(state, robot) for robot in robots)


def give_up_work_of_lost_robots(state: State) -> State:
    """A plan that counts on a lost robot is reallocated; what is under way there is cancelled."""
    for robot in state.gone_since:
        if not lost(state, robot):
            continue
        reason = f"robot {robot} has been away for {state.policy.lost_after_s:g} s"
        if robot not in state.robots:
            reason = f"robot {robot} was unregistered"
        for plan in state.index.active:
            if _counts_on(state, plan, robot):
                state = _give_up(state, plan, robot, reason)
        if robot not in state.robots and not state.connected.get(robot):
            state = _write_off(state, robot, reason)
    return state


def next_loss(state: State) -> float | None:
    """When, by `State.monotonic_s`, a robot that is away becomes lost to a plan that needs it."""
    if not state.gone_since:
        return None
    active = (state.plans[plan] for plan in state.index.active)
    counting = [
        entry.plan.plan
        for entry in active
        if entry.job is None and (entry.replan is None or entry.cancelling)
    ]
    times = [
        since + state.policy.lost_after_s
        for robot, since in state.gone_since.items()
        if not lost(state, robot) and any(_counts_on(state, plan, robot) for plan in counting)
    ]
    return min(times, default=None)


def _give_up(state: State, plan: str, robot: str, reason: str) -> State:
    entry = state.plans[plan]
    under_way = [
        record
        for record in entry.outstanding()
        if robot in robots_of(record) and record.task not in entry.unwanted
    ]
    if not under_way and entry.cancelling:
        # Only where that ends it: to look again and again while others have not spoken never ends.
        return touch(state, Touch(Part.PLAN, plan)) if all_lost(state, entry) else state
    if not under_way and entry.replan is not None:
        return state
    if state.logic < SINCE_LOGIC:
        given_up = [replace(record, state=TaskState.FAILED, reason=reason) for record in under_way]
    else:
        given_up = [replace(record, reason=reason) for record in under_way]
        unwanted = (*entry.unwanted, *(record.task for record in given_up))
        entry = replace(entry, unwanted=unwanted)
    entry = entry.to_replan(ReplanScope.REALLOCATE, reason, robots=(robot,))
    return set_records(state, entry, given_up)


def _write_off(state: State, robot: str, reason: str) -> State:
    """Nobody will ever report on these orders."""
    for plan in sorted({plan for plan, _ in state.index.work.get(robot, ())}):
        entry = state.plans[plan]
        written_off = [
            replace(record, state=TaskState.CANCELLED, reason=reason)
            for record in entry.outstanding()
            if record.robot == robot
        ]
        if written_off:
            state = set_records(state, entry, written_off)
    return state


def _counts_on(state: State, plan: str, robot: str) -> bool:
    """Whether the plan has something to do for a robot that was not given up."""
    entry = state.plans[plan]
    position, unwanted = entry.index.graph.position, entry.unwanted
    dropped = entry.cancelling and state.logic >= DROPPED_SINCE_LOGIC
    return robot in entry.index.needs or any(
        name == plan
        and (dropped or (task in position and (entry.cancelling or task not in unwanted)))
        for name, task in state.index.work.get(robot, ())
    )
