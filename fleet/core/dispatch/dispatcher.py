"""The dispatcher: every plan goes as far as it can, and nobody waits for the head of a line."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.dispatch.deadlock import break_deadlock
from fleet.core.dispatch.delays import next_lateness
from fleet.core.dispatch.lost_robots import give_up_work_of_lost_robots, lost, next_loss
from fleet.core.dispatch.ready_tasks import by_priority, order_if_ready
from fleet.core.dispatch.replan_triggers import unforeseen
from fleet.core.dispatch.while_replanning import stands_still
from fleet.core.handlers.goals import next_stage
from fleet.core.handlers.requests import plan_waiting_goals
from fleet.core.plan_entry import PlanEntry
from fleet.core.replan_reasons import ReplanScope
from fleet.core.revision.replanning import start_replanning
from fleet.core.state import State
from fleet.core.state_updates import give_up, mark_goals, set_entry, with_waiting_cancelled
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.tasks import TaskState


def advance(state: State) -> State:
    """Take every plan as far as it goes without news: orders, replans, ends."""
    state = give_up_work_of_lost_robots(state)
    if state.policy.auto_plan:
        state = plan_waiting_goals(state)
    plans = by_priority(state)
    for plan in plans:
        if state.plans[plan].state is PlanState.RUNNING:
            state = _run(state, plan)
        entry = state.plans[plan]
        if entry.cancelling and not entry.ended:
            state = _cancel(state, entry)
        elif entry.job is None and entry.replan is not None and not entry.ended:
            state = start_replanning(state, entry)
    moved = break_deadlock(state, plans)
    return state if moved is state else advance(moved)


def next_timer(state: State) -> float | None:
    """When time alone changes something, by `State.monotonic_s`: a loss, or a late task."""
    times = [at_s for at_s in (next_loss(state), next_lateness(state)) if at_s is not None]
    return min(times, default=None)


def _cancel(state: State, entry: PlanEntry) -> State:
    outstanding = entry.outstanding()
    if any(record.robot is None or not lost(state, record.robot) for record in outstanding):
        return state  # their orders now say `cancelled`; the workers' reports bring us back here
    unwanted = tuple(record.task for record in outstanding)
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
    return mark_goals(
        state, entry.plan.goals, GoalState.WAITING, None, f"plan {entry.plan.plan} was cancelled"
    )


def _run(state: State, plan: str) -> State:
    """What is reached is marked, what is done ends, and what is ready is ordered: also while the
    plan is made again, as far as that does not touch it."""
    if state.plans[plan].cancelling or stands_still(state, state.plans[plan]):
        return state
    state = _mark_reached(state, state.plans[plan])
    entry = state.plans[plan]
    if entry.job is None and entry.replan is None:
        if (changed := unforeseen(state, entry)) is not None:
            state = set_entry(state, changed)
        elif all(record.state is TaskState.SUCCEEDED for record in entry.current()):
            return set_entry(state, replace(entry, state=PlanState.SUCCEEDED))
        elif any(r.state in (TaskState.FAILED, TaskState.CANCELLED) for r in entry.current()):
            return give_up(state, entry, "a task of the plan was cancelled or failed")
    for record in list(entry.current()):
        if record.state is TaskState.WAITING and not state.plans[plan].ended:
            state = order_if_ready(state, plan, record)
    return state


def _mark_reached(state: State, entry: PlanEntry) -> State:
    """A stage of a goal is reached when all its tasks are done and its conditions hold."""
    world = state.world()
    unfinished = {
        record.goal for record in entry.current() if record.state is not TaskState.SUCCEEDED
    }
    for goal in entry.plan.goals:
        status = state.goal_states.get(goal)
        if (
            status is None
            or status.state in ENDED_GOALS
            or goal in unfinished
            or not all(world.holds(condition) for condition in status.conditions)
        ):
            continue
        entry = replace(state.plans[entry.plan.plan], fruitless_replans=0)
        if status.stage + 1 < len(status.stages):
            state = next_stage(state, goal)
            reason = f"goal {goal} goes on with its next step"
            entry = entry.to_replan(ReplanScope.REPAIR, reason, goals=(goal,))
            state = set_entry(state, entry)
        else:
            state = set_entry(state, entry)
            state = mark_goals(state, (goal,), GoalState.REACHED, entry.plan.plan)
    return state
