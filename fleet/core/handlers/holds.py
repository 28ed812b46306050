"""Pauses and drains come and go."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.belief_updates import robot_changed
from fleet.core.dispatch.standing.goals import look_again
from fleet.core.indexes.plan_index import robots_of
from fleet.core.indexes.touches import Part, Touch
from fleet.core.state import State
from fleet.core.state_updates import set_entry, touch
from keyexpr_schema.payloads.holds import Hold


def hold_put(state: State, event: events.HoldPut) -> State:
    """What it names gets no new order; with `interrupt`, what runs there is given back."""
    hold = event.hold
    known = state.holds.get(hold.hold)
    if known == hold:
        return state
    state = replace(state, holds=state.holds.set(hold.hold, hold))
    if known is not None:  # what is not among it any more goes on
        state = _looked_at(state, known)
    state = _looked_at(state, hold)
    return _interrupt(state, hold) if hold.interrupt else state


def hold_deleted(state: State, event: events.HoldDeleted) -> State:
    """Work goes on, where nothing else holds it."""
    hold = state.holds.get(event.hold)
    if hold is None:
        return state
    return _looked_at(replace(state, holds=state.holds.without(event.hold)), hold)


def _looked_at(state: State, hold: Hold) -> State:
    for plan in hold.plans:
        if plan in state.plans:
            state = touch(state, Touch(Part.PLAN, plan))
    for schedule in hold.schedules:
        state = look_again(state, schedule)
    for robot in state.robots if hold.of_all else hold.robots:
        state = robot_changed(state, robot)
    return state


def _interrupt(state: State, hold: Hold) -> State:
    for plan in state.index.active:
        entry = state.plans[plan]
        here = hold.of_all or plan in hold.plans
        tasks = [
            record.task
            for record in entry.outstanding()
            if here or not robots_of(record).isdisjoint(hold.robots)
        ]
        halting = tuple(dict.fromkeys([*entry.halting, *tasks]))
        if halting != entry.halting:
            state = set_entry(state, replace(entry, halting=halting))
    return state
