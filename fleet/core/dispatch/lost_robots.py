"""Robots whose worker has been away for too long: their tasks have failed."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.plan_entry import ReplanScope
from fleet.core.state import State
from fleet.core.state_updates import set_entry
from keyexpr_schema.payloads.tasks import TaskState


def fail_tasks_of_lost_robots(state: State) -> State:
    """A plan that counts on a lost robot is reallocated; what was under way there has failed."""
    for robot, since in state.gone_since.items():
        if state.wall_time_s - since < state.policy.lost_after_s:
            continue
        reason = f"robot {robot} has been away for {state.policy.lost_after_s:g} s"
        if robot not in state.robots:
            reason = f"robot {robot} was unregistered"
        for plan in state.index.active:
            entry = state.plans[plan]
            if robot not in entry.index.needs:
                continue
            failed = {
                record.task: replace(record, state=TaskState.FAILED, reason=reason)
                for record in entry.outstanding()
                if robot in (record.robot, *record.args.values())
            }
            if failed or entry.replan is None:
                entry = replace(entry, records=entry.records.updated(failed))
                state = set_entry(state, entry.to_replan(ReplanScope.REALLOCATE, reason))
    return state


def next_loss(state: State) -> float | None:
    """The Unix time [s] at which a robot that is away becomes lost to a plan that counts on it."""
    if not state.gone_since:
        return None
    active = (state.plans[plan] for plan in state.index.active)
    counting = [entry for entry in active if entry.job is None and entry.replan is None]
    times = [
        since + state.policy.lost_after_s
        for robot, since in state.gone_since.items()
        if any(robot in entry.index.needs for entry in counting)
    ]
    return min(times, default=None)
