"""Places, objects and facts."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.belief_updates import (
    as_written,
    believe,
    forget_fact,
    forget_object,
    set_object,
)
from fleet.core.dispatch.replan_triggers import contradicted
from fleet.core.dispatch.while_replanning import stands_still
from fleet.core.handlers import goals, statements
from fleet.core.state import State
from fleet.core.state_updates import (
    set_entry,
)
from keyexpr_schema.facts import FactKey
from keyexpr_schema.payloads.plans import PlanState


def fact_put(state: State, event: events.FactPut) -> State:
    """Believe the fact: its key holds the latest word. A plan that it contradicts is repaired."""
    fact = as_written(state, event.fact)
    known = state.facts.get(fact.key)
    changed = believe(state, fact)
    if changed is state:
        return state
    state = changed
    for plan in state.index.active:
        entry = state.plans[plan]
        if entry.state is not PlanState.RUNNING or stands_still(state, entry):
            continue
        said_again = known is not None and known.value == fact.value
        if said_again and any(fact.key in reason.variables for reason in entry.reasons):
            continue  # it is being seen to
        if (against := contradicted(state, entry, fact)) is not None:
            state = set_entry(state, against)
    return state


def fact_deleted(state: State, event: events.FactDeleted) -> State:
    """No longer believe anything of that variable."""
    return forget_fact(state, FactKey(event.relation, event.subject))


def place_put(state: State, event: events.PlacePut) -> State:
    """A new place may make sentences understood."""
    if state.places.get(event.place.place) == event.place:
        return state
    return vocabulary_changed(
        replace(state, places=state.places.set(event.place.place, event.place))
    )


def place_deleted(state: State, event: events.PlaceDeleted) -> State:
    """Sentences once understood stay so."""
    return replace(state, places=state.places.without(event.place))


def object_put(state: State, event: events.ObjectPut) -> State:
    """A new object may make sentences understood."""
    if state.objects.get(event.object.object) == event.object:
        return state
    return vocabulary_changed(set_object(state, event.object))


def object_deleted(state: State, event: events.ObjectDeleted) -> State:
    """Sentences once understood stay so."""
    return forget_object(state, event.object)


def vocabulary_changed(state: State) -> State:
    """Read again, with other names, what was not understood."""
    return statements.understand_again(goals.understand_again(state))
