"""Closures come and go: work behind them is planned anew, and what waits for them goes on."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.closed_ways import opened, without_closed_ways
from fleet.core.state import State
from fleet.core.state_updates import set_entry


def closure_put(state: State, event: events.ClosurePut) -> State:
    """Work that robots do not get to now goes to others, or waits."""
    closure = event.closure
    known = state.closures.get(closure.closure)
    if known == closure:
        return state
    if known is not None:
        state = opened(state, known)
    if closure.is_over(state.time_s):
        return state
    state = replace(state, closures=state.closures.set(closure.closure, closure))
    if closure.one_at_a_time:
        return state
    world = state.world()
    for plan in state.index.active:
        entry = state.plans[plan]
        changed = without_closed_ways(state, entry, world)
        if changed is not entry:
            state = set_entry(state, changed)
    return state


def closure_deleted(state: State, event: events.ClosureDeleted) -> State:
    """What waited for it goes on."""
    known = state.closures.get(event.closure)
    return state if known is None else opened(state, known)
