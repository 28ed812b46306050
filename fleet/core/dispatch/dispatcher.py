"""The dispatcher: every plan goes as far as it can, and nobody waits for the head of a line."""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from fleet.core.closed_ways import end_closures
from fleet.core.dispatch.activation import next_start
from fleet.core.dispatch.charging import look_at_charge
from fleet.core.dispatch.concerns import WATCHED_SINCE_LOGIC, Concerns
from fleet.core.dispatch.deadlock import break_deadlock
from fleet.core.dispatch.delays import next_lateness, react_to_delays
from fleet.core.dispatch.drained_robots import move_work_of_drained_robots
from fleet.core.dispatch.lost_robots import (
    all_lost,
    give_up_work_of_lost_robots,
    next_loss,
)
from fleet.core.dispatch.own_again import keep_own, plan_own_again
from fleet.core.dispatch.put_downs import note_what_failed_left, put_down_what_is_left
from fleet.core.dispatch.ready_tasks import by_priority, may_order, order_ready
from fleet.core.dispatch.replan_triggers import unforeseen
from fleet.core.dispatch.standing.goals import look_again, wake
from fleet.core.dispatch.trajectory import broken, with_passed
from fleet.core.handlers.goals import next_stage
from fleet.core.handlers.requests import plan_waiting_goals
from fleet.core.indexes.touches import UNTOUCHED
from fleet.core.plan_entry import SAYS_WHY_SINCE_LOGIC, PlanEntry
from fleet.core.replan_reasons import ReplanScope
from fleet.core.revision.replanning import start_replanning
from fleet.core.state import State
from fleet.core.state_updates import (
    give_up,
    mark_goals,
    set_entry,
    with_waiting_cancelled,
)
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalState
from keyexpr_schema.payloads.plans import PlanState

MOST_PASSES = 20_000
"""Far more than what one event can lead to."""


def advance(state: State) -> State:
    """Take every plan as far as it goes without news: orders, replans, ends.

    What is looked at is what the event, and then what dispatch itself, has changed.

    Raises:
        RuntimeError: that never ends, which is a fault here: the event is set aside like any other
            that breaks the core, and the planner goes on.
    """
    looked = UNTOUCHED
    for _ in range(MOST_PASSES):
        state = end_closures(state)
        state = move_work_of_drained_robots(give_up_work_of_lost_robots(state))
        state = wake(react_to_delays(state))
        state = plan_waiting_goals(put_down_what_is_left(state))
        if state.touches is looked:
            return state
        concerns = Concerns.of(state, state.touches.since(looked))
        looked = state.touches
        state = _look_at(state, concerns)
        if state.touches is looked:
            state = break_deadlock(state)
    raise RuntimeError(f"dispatch does not come to rest in {MOST_PASSES} passes")


def next_timer(state: State) -> float | None:
    """When time alone changes something, by `State.monotonic_s`: a loss, a late task, or a goal to
    begin."""
    found = (next_loss(state), next_lateness(state), next_start(state))
    return min((at_s for at_s in found if at_s is not None), default=None)


def _look_at(state: State, concerns: Concerns) -> State:
    """What is reached is marked, what is done ends, and what is ready is ordered: also while the
    plan is made again, as far as that does not touch it."""
    for goal in sorted(concerns.held):
        state = look_again(state, goal)
    for goal in sorted(concerns.failed):
        state = note_what_failed_left(state, goal)
    for robot in sorted(concerns.charges):
        state = look_at_charge(state, robot)
    for goal in sorted(concerns.own):
        state = keep_own(state, goal)
    robots = sorted(concerns.robots)
    concerned = {*concerns.plans, *concerns.teams, *concerns.goals, *concerns.tasks}
    if robots:
        concerned.update(state.index.active)
    for plan in by_priority(state, concerned):
        whole = plan in concerns.plans
        watched = state.plans[plan].plan.goals if whole else sorted(concerns.goals.get(plan, ()))
        state = with_passed(state, watched)
        entry = state.plans[plan]
        if may_order(state, entry):
            state = _mark_reached(state, entry, watched)
            if not whole and state.logic >= WATCHED_SINCE_LOGIC:
                state = _keep_constraints(state, state.plans[plan], watched)
            if whole or plan in concerns.teams:
                state = _end_or_replan(state, state.plans[plan])
            entry = state.plans[plan]
            ready = (robot for robot in robots if robot in entry.index.ready)
            state = order_ready(state, plan, concerns.tasks.get(plan, ()), ready)
        if whole or plan in concerns.teams:
            state = _cancel_or_make_again(state, state.plans[plan])
    return state


def _end_or_replan(state: State, entry: PlanEntry) -> State:
    if entry.job is not None or entry.replan is not None:
        return state
    if (changed := unforeseen(state, entry)) is not None:
        return set_entry(state, changed)
    if entry.index.unfinished == 0:
        # What it had waited for on the way, or was tried in vain, is no reason for how it ended.
        done = replace(entry, state=PlanState.SUCCEEDED, reason=None, violations=())
        return set_entry(state, done)
    if entry.index.broken:
        return give_up(state, entry, "a task of the plan was cancelled or failed")
    return state


def _keep_constraints(state: State, entry: PlanEntry, goals: Iterable[str]) -> State:
    if entry.job is not None or entry.replan is not None:
        return state
    changed = broken(state, entry, goals)
    return state if changed is None else set_entry(state, changed)


def _cancel_or_make_again(state: State, entry: PlanEntry) -> State:
    if entry.ended:
        return state
    if entry.cancelling:
        return _cancel(state, entry)
    if entry.job is None and entry.replan is not None:
        waits = entry.waits_for_team == state.team_number
        return state if waits else start_replanning(state, entry)
    return state


def _cancel(state: State, entry: PlanEntry) -> State:
    if not all_lost(state, entry):
        return state  # their orders now say `cancelled`; the workers' reports bring us back here
    unwanted = tuple(record.task for record in entry.outstanding())
    records = with_waiting_cancelled(entry, "the plan was cancelled")
    entry = replace(
        entry,
        state=PlanState.CANCELLED,
        cancelling=False,
        records=records,
        unwanted=unwanted,
        reasons=(),
    )
    state = set_entry(state, entry)
    reason = entry.reason if state.logic >= SAYS_WHY_SINCE_LOGIC else None
    reason = reason or f"plan {entry.plan.plan} was cancelled"
    state = mark_goals(state, entry.plan.goals, GoalState.WAITING, None, reason)
    return plan_own_again(state, entry.plan.goals)


def _mark_reached(state: State, entry: PlanEntry, goals: Iterable[str]) -> State:
    """A stage of a goal is reached when all its tasks are done and its conditions hold."""
    world = state.world()
    for goal in goals:
        status = state.goal_states.get(goal)
        if (
            status is None
            or status.state in ENDED_GOALS
            or (entry.wishes and goal not in entry.plan.goals)
            or goal in entry.index.goal_open
            or not all(world.holds(condition) for condition in status.conditions)
        ):
            continue
        entry = state.plans[entry.plan.plan]
        if status.stage + 1 < len(status.stages):
            state = next_stage(state, goal)
            reason = f"goal {goal} goes on with its next step"
            entry = replace(entry, fruitless_replans=0)
            entry = entry.to_replan(ReplanScope.REPAIR, reason, goals=(goal,))
            state = set_entry(state, entry)
        else:
            if entry.fruitless_replans:
                state = set_entry(state, replace(entry, fruitless_replans=0))
            state = mark_goals(state, (goal,), GoalState.REACHED, entry.plan.plan)
    return state
