"""The core returns, whatever valid values come on the keys that the planner watches."""

from __future__ import annotations

import enum
import types
import typing
from functools import partial
from typing import Any

import msgspec
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fleet.core import events
from fleet.core.dispatch.dispatcher import next_timer
from fleet.core.effects import effects_of
from fleet.core.events import Event, decode_event, encode_event
from fleet.core.step import step
from fleet.service.event_translation import WATCHED, event_of
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.facts import AT, HOLDING, LOCATED, ON, SEARCHED
from keyexpr_schema.key import Key, decode_payload
from keyexpr_schema.transport.watch import Change
from tests.support.fleet_model import FleetModel
from tests.support.household import bring, carrier, manipulator
from tests.support.reached import reaches

NAMES = (
    "hsr", "cart", "cup_1", "cup_2", "kitchen", "hallway", "living_room", "nothing", "p", "plan-1",
    "g", "g-1", "t1", "t2", "a1", "r1", "unheard_of", AT, HOLDING, ON, SEARCHED, LOCATED,
    "navigate", "pick", "place", "symbolic", "makespan", "big-dag",
)  # fmt: skip
SENTENCES = (
    "Bring cup 1 to the hallway", "Bring every cup to the kitchen", "Find cup 2", "", "?",
    "first bring cup 1 to the hallway, then to the kitchen", "a robot holds the cup",
    "Whenever cup 1 is in the hallway, bring it to the kitchen",
    "If cup 1 is not in the kitchen, bring cup 2 to the hallway; otherwise find cup 2",
    "cup 1 is in the kitchen", "?a1", "?", "hsr", "kitchen", "true", "x" * 300,
)  # fmt: skip
TOKENS = [
    "bring",
    "move",
    "find",
    "cup",
    "1",
    "2",
    "²",
    "99999999999999999999",
    "all",
    "to",
    "the",
    ",",
    "then",
    "and",
    "not",
    "hallway",
    "kitchen",
    "is",
    "in",
    "at",
    "on",
    "it",
    ".",
    "first",
    "last",
    "every",
    "robot",
    "holds",
    "whenever",
    "otherwise",
]
WORDS = st.one_of(
    st.sampled_from((*NAMES, *SENTENCES, "?a1", "?x2", "?")),
    st.lists(st.sampled_from(TOKENS), max_size=9).map(" ".join),
    st.text(max_size=8),
)
NUMBERS = st.sampled_from((0.0, 1.0, -1.0, 0.5, 1e9, -1e9, 1e308))
PLAIN: dict[Any, st.SearchStrategy[Any]] = {
    str: WORDS,
    int: st.sampled_from((0, 1, 2, 3, -1, 2**53, -(2**63), 2**64 - 1)),
    float: NUMBERS,
    bool: st.booleans(),
    type(None): st.none(),
}


def of(kind: Any) -> st.SearchStrategy[Any]:
    """Values of `kind` with few names in them, so that they have to do with each other."""
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Annotated:
        return st.sampled_from(NAMES) if args[0] is str else of(args[0])
    if origin in (typing.Union, types.UnionType):
        return st.one_of([of(one) for one in args])
    if origin is tuple and args[-1] is Ellipsis:
        return st.lists(of(args[0]), max_size=3).map(tuple)
    if origin is tuple:
        return st.tuples(*(of(one) for one in args))
    if origin is dict:
        return st.dictionaries(of(args[0]), of(args[1]), max_size=2)
    if isinstance(kind, type) and issubclass(kind, enum.Enum):
        return st.sampled_from(kind)
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        fields = msgspec.structs.fields(kind)
        return st.builds(
            kind,
            **{f.name: of(f.type) for f in fields if f.required},
        ).flatmap(lambda least: _with_some(kind, least, fields))
    return PLAIN[kind]


def _with_some(kind: Any, least: Any, fields: Any) -> st.SearchStrategy[Any]:
    optional = {f.name: of(f.type) for f in fields if not f.required}
    return st.fixed_dictionaries({}, optional=optional).map(
        lambda more: msgspec.structs.replace(least, **more)
    )


@st.composite
def changes(draw: st.DrawFn) -> tuple[Key[Any, Any], Any, Any]:
    """A value that decodes, on the key that it speaks of, or the deletion of one."""
    key = draw(st.sampled_from(WATCHED))
    value = draw(PAYLOADS[key.name])
    address = key.address(*(getattr(value, name) for name in key.address.__struct_fields__))
    return key, address, draw(st.sampled_from((value, value, value, None)))


def _has_an_address(key: Key[Any, Any], value: Any) -> bool:
    fields = (getattr(value, name) for name in key.address.__struct_fields__)
    return all(isinstance(field, str) or field > 0 for field in fields)


PAYLOADS = {key.name: of(key.payload).filter(partial(_has_an_address, key)) for key in WATCHED}


def fleet() -> FleetModel:
    model = FleetModel((manipulator(), carrier()), cups=2)
    model.plan(bring(1, "hallway"))
    return model


FLEET = fleet()


@reaches("put", "deleted", "changed", "plan under way")
@given(
    story=st.lists(
        st.one_of(changes().map(lambda c: ("change", c)), st.just(("robot", None))), max_size=6
    ),
    policy=st.builds(dict, auto_plan=st.booleans(), approval=st.booleans()),
)
@settings(
    max_examples=100, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)
def test_no_value_breaks_the_core(reached: Any, story: Any, policy: Any) -> None:
    state = FLEET.state
    at = {"time_s": 1e3, "wall_time_s": 1e3}
    started = events.PlannerStarted(
        epoch=2,
        incarnation="fuzz",
        policy=msgspec.structs.replace(state.policy, **policy),
        skills=state.skills,
        logic=state.logic,
        **at,
    )
    state, _ = step(state, started)
    for what, change in story:
        if what == "robot":
            event: Event | None = events.WorkerDisconnected(robot="hsr", incarnation="i1", **at)
        else:
            key, address, value = change
            try:
                if value is not None:
                    decode_payload(key.payload, key.encode(value), "here")
            except SchemaError:
                continue
            reached["deleted" if value is None else "put"] += 1
            event = event_of(Change(key, address, value, "0/0"), at)
        if event is None:
            continue
        event = decode_event(encode_event(event))
        after, _ = step(state, event)
        reached["changed"] += after is not state
        reached["plan under way"] += any(not e.ended for e in after.plans.values())
        state = after
        next_timer(state)
    effects_of(state)
