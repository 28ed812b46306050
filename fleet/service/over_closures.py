"""Closures whose time is over leave their keys: the core has forgotten them."""

from __future__ import annotations

from collections.abc import Iterator

from fleet.core import events
from fleet.core.effects import Retract
from fleet.core.events import Event
from fleet.core.state import State
from keyexpr_schema.keyspace import CLOSURE
from keyexpr_schema.payloads.closures import ClosureAddress


def over_closures(event: Event, before: State, after: State) -> Iterator[Retract]:
    """The keys of closures that an event has brought to an end: their time has come, or had when
    they were heard of. Those that somebody deletes are gone already."""
    if isinstance(event, events.ClosurePut):
        if event.closure.is_over(max(event.time_s, after.time_s)):
            yield Retract(CLOSURE, ClosureAddress(event.closure.closure))
    elif after.closures is not before.closures and not isinstance(event, events.ClosureDeleted):
        for name in before.closures:
            if name not in after.closures:
                yield Retract(CLOSURE, ClosureAddress(name))
