"""Robots whose worker has been away for too long: their tasks have failed."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.plan_entry import PlanEntry, ReplanScope
from fleet.core.state import State
from fleet.core.state_updates import set_entry
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskState


def fail_tasks_of_lost_robots(state: State) -> State:
    """A plan that counts on a lost robot is reallocated; what was under way there has failed."""
    for robot, since in state.gone_since.items():
        if state.wall_time_s - since < state.policy.lost_after_s:
            continue
        reason = f"robot {robot} has been away for {state.policy.lost_after_s:g} s"
        if robot not in state.robots:
            reason = f"robot {robot} was unregistered"
        for entry in state.plans.values():
            if entry.ended or not _needs(entry, robot):
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
    counting = [
        entry
        for entry in state.plans.values()
        if not entry.ended and entry.job is None and entry.replan is None
    ]
    times = [
        since + state.policy.lost_after_s
        for robot, since in state.gone_since.items()
        if any(_needs(entry, robot) for entry in counting)
    ]
    return min(times, default=None)


def _needs(entry: PlanEntry, robot: str) -> bool:
    return any(
        record.state not in ENDED_TASKS and robot in (record.robot, *record.args.values())
        for record in entry.current()
    )
