"""Places, objects and facts."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.belief_updates import (
    as_written,
    believe,
    forget_fact,
    forget_object,
    let_go,
    set_object,
)
from fleet.core.dispatch.replan_triggers import react_to_fact
from fleet.core.handlers import goals, statements
from fleet.core.state import State
from keyexpr_schema.facts import FactKey


def fact_put(state: State, event: events.FactPut) -> State:
    """Believe the fact: its key holds the latest word. A plan that it contradicts is repaired."""
    fact = as_written(state, event.fact)
    known = state.facts.get(fact.key)
    changed = believe(state, fact)
    if changed is state:
        return state
    said_again = known is not None and known.value == fact.value
    changed, gone = let_go(changed, state, fact)
    changed = react_to_fact(changed, fact, said_again)
    return changed if gone is None else react_to_fact(changed, gone, False)


def fact_deleted(state: State, event: events.FactDeleted) -> State:
    """No longer believe anything of that variable."""
    return forget_fact(state, FactKey(event.relation, event.subject))


def place_put(state: State, event: events.PlacePut) -> State:
    """A new place may make sentences understood."""
    known = state.places.get(event.place.place)
    if known is not None and replace(known, by=event.place.by) == event.place:
        return state
    state = replace(state, places=state.places.set(event.place.place, event.place))
    return vocabulary_changed(state, event.place.place)


def place_deleted(state: State, event: events.PlaceDeleted) -> State:
    """Sentences once understood stay so."""
    return replace(state, places=state.places.without(event.place))


def object_put(state: State, event: events.ObjectPut) -> State:
    """A new object may make sentences understood."""
    known = state.objects.get(event.object.object)
    if known is not None and replace(known, by=event.object.by) == event.object:
        return state
    return vocabulary_changed(set_object(state, event.object), event.object.object)


def object_deleted(state: State, event: events.ObjectDeleted) -> State:
    """Sentences once understood stay so."""
    return forget_object(state, event.object)


def vocabulary_changed(state: State, new: str) -> State:
    """Read again, with the name `new`, what was not understood."""
    return statements.understand_again(goals.understand_again(state, new))
