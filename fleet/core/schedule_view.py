"""What the planner publishes of schedules."""

from __future__ import annotations

from fleet.core.model.recurrence import clock_at
from fleet.core.standing import is_scheduled
from fleet.core.state import State
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.schedules import ScheduleState, ScheduleStatus


def schedule_status(state: State, name: str) -> ScheduleStatus | None:
    """How a schedule stands, or a goal whose sentence says that it is one; `None` if it is none."""
    schedule, spec = state.schedules.get(name), state.goals.get(name)
    status = state.goal_states.get(name)
    scheduled = is_scheduled(state, name)
    if schedule is not None and not scheduled:
        text = schedule.goal.text
        if spec is None:
            return ScheduleStatus(schedule=name, state=ScheduleState.OVER, text=text)
        reason = f"there is a goal {name} already: give the schedule another name"
        return ScheduleStatus(schedule=name, state=ScheduleState.REJECTED, text=text, reason=reason)
    if spec is None or status is None:
        return None
    standing = status.state is GoalState.STANDING and spec.every is not None
    if not (standing or scheduled):
        return None
    zones = state.time_zones()

    def shown(at_s: float | None) -> str | None:
        clock = None if at_s is None else clock_at(spec, at_s, zones)
        return None if clock is None else clock.isoformat(timespec="seconds")

    begins_s = spec.said_s if spec.not_before_s is None else spec.not_before_s
    if standing:
        found = ScheduleState.PAUSED if status.paused else ScheduleState.ACTIVE
    else:
        reading = status.state is GoalState.READING
        found = ScheduleState.READING if reading else ScheduleState.REJECTED
    return ScheduleStatus(
        schedule=name,
        state=found,
        text=spec.text,
        every=spec.every,
        zone=spec.zone,
        of_goal=not scheduled,
        understood=status.understood,
        begins=shown(begins_s),
        begins_s=begins_s,
        next=shown(status.next_s),
        next_s=status.next_s,
        last=shown(status.latest_s),
        last_s=status.latest_s,
        latest=status.latest,
        going_on=status.parts,
        queued=tuple(at for at in map(shown, status.queued_s) if at is not None),
        runs=status.runs,
        missed=status.missed,
        skipped=status.skipped,
        reason=status.reason,
    )
