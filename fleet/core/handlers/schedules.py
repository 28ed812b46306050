"""Schedules come and go, and what is known of time zones."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.handlers.goals import drop_goal, take_put_goal, understand_again
from fleet.core.indexes.touches import Part, Touch
from fleet.core.model.recurrence import recurrence_of
from fleet.core.standing import is_scheduled, wanted_by, with_times
from fleet.core.state import State
from fleet.core.state_updates import set_goal, touch
from keyexpr_schema.payloads.goals import GoalState


def schedule_put(state: State, event: events.SchedulePut) -> State:
    """Keep a schedule; what it wants is a goal of its name, unless somebody has put one."""
    schedule = event.schedule
    name = schedule.schedule
    if state.schedules.get(name) == schedule:
        return state
    free = name not in state.goals or is_scheduled(state, name)
    state = replace(state, schedules=state.schedules.set(name, schedule))
    state = touch(state, Touch(Part.SCHEDULE, name))
    return take_put_goal(state, wanted_by(schedule)) if free else state


def schedule_deleted(state: State, event: events.ScheduleDeleted) -> State:
    """Forget a schedule; the run that goes on does so."""
    name = event.schedule
    if name not in state.schedules:
        return state
    scheduled = is_scheduled(state, name)
    state = replace(state, schedules=state.schedules.without(name))
    state = touch(state, Touch(Part.SCHEDULE, name))
    return drop_goal(state, name) if scheduled else state


def time_zone_read(state: State, event: events.TimeZoneRead) -> State:
    """Go by these rules from now on: what comes next comes when clocks will show it."""
    known = state.zones.get(event.zone)
    if known == event.offsets or not event.offsets:
        return state
    state = replace(state, zones=state.zones.set(event.zone, event.offsets))
    if known is None:
        return understand_again(state)
    for name in with_times(state):
        spec, status = state.goals[name], state.goal_states[name]
        later = status.next_s is not None and status.next_s > state.time_s
        if later and spec.zone == event.zone and status.state is GoalState.STANDING and spec.every:
            times = recurrence_of(spec, state.time_zones())
            state = set_goal(state, replace(status, next_s=times.next_after(state.time_s)))
        state = touch(state, Touch(Part.SCHEDULE, name))
    return state
