"""Closures leave their keys when their time is over, and at no other time."""

from __future__ import annotations

from typing import Any

from fleet.core import events
from fleet.core.effects import Retract
from fleet.core.state import State
from fleet.core.step import step
from fleet.service.over_closures import over_closures
from keyexpr_schema.keyspace import CLOSURE
from keyexpr_schema.payloads.closures import Closure, ClosureAddress


def closure(name: str, until_s: float | None) -> Closure:
    return Closure(closure=name, names=("hall",), region_m=((0.0, 0.0, 1.0, 1.0),), until_s=until_s)


def after(state: State, kind: Any, time_s: float, **what: Any) -> tuple[State, list[Retract]]:
    event = kind(time_s=time_s, wall_time_s=time_s, **what)
    now, _ = step(state, event)
    return now, list(over_closures(event, state, now))


def test_a_closure_leaves_its_key_when_its_time_is_over() -> None:
    state, gone = after(State(), events.ClosurePut, 10.0, closure=closure("a", 20.0))
    state, more = after(state, events.ClosurePut, 11.0, closure=closure("b", None))
    state, none = after(state, events.ClosurePut, 12.0, closure=closure("c", 90.0))
    assert gone == more == none == []
    state, gone = after(state, events.TimerFired, 25.0)
    assert gone == [Retract(CLOSURE, ClosureAddress("a"))]
    state, gone = after(state, events.ClosureDeleted, 26.0, closure="c")
    assert gone == [] and [*state.closures] == ["b"]
    state, gone = after(state, events.ClosurePut, 27.0, closure=closure("late", 27.0))
    assert gone == [Retract(CLOSURE, ClosureAddress("late"))], "it was over when it was heard of"
