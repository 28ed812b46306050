"""Conditions as nodes of the engine, held against what the model says of every state."""

from __future__ import annotations

from itertools import product

from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.core.model import derived
from fleet.core.model.world import WorldModel
from fleet.planners.symbolic.engine.conditions import Conditions
from fleet.planners.symbolic.engine.nodes import Nodes
from fleet.planners.symbolic.engine.travel import Travel
from keyexpr_schema.facts import AT, HOLDING, IS_OPEN, REACHABLE, FactKey, Literal, Value
from keyexpr_schema.payloads.world import Object
from tests.support.household import PLACES, SKILLS, carrier, fact, manipulator
from tests.support.reached import Reached, reaches

THINGS = ("cup", "tray", "box")
CARRIERS: dict[str, tuple[str, ...]] = {
    "cup": ("kitchen", "hallway", "tray", "box", "drawer", "hsr", "locobot", "anna"),
    "tray": ("kitchen", "box", "drawer", "hsr", "locobot"),
    "box": ("kitchen", "hallway", "hsr", "locobot"),
}
"""What can carry what; a box is never in what it can hold."""


def _thing(name: str, *features: str, **more: object) -> Object:
    return Object(object=name, kind=name, label=name, features=features, **more)  # type: ignore[arg-type]


@st.composite
def states(draw: st.DrawFn) -> tuple[WorldModel, dict[FactKey, Value]]:
    """Things in one another, in a drawer, in hands and in a basket; and how it all is."""
    objects = (
        _thing("cup"),
        _thing("tray", "supports"),
        _thing("box", "contains", "openable"),
        _thing("drawer", "contains", "openable", movable=False, part_of="cabinet"),
        _thing("cabinet", movable=False, home="kitchen"),
        _thing("anna", "person", movable=False),
    )
    robots = manipulator(), carrier()
    facts = (
        fact("hsr", "at", draw(st.sampled_from(("kitchen", "hallway")))),
        fact("locobot", "at", draw(st.sampled_from(("kitchen", "hallway")))),
        fact("anna", "at", "hallway"),
    )
    world = WorldModel.of(SKILLS, PLACES, objects, robots, facts)
    values = dict(world.facts)
    for thing in THINGS:
        values[FactKey(AT, thing)] = draw(st.sampled_from(CARRIERS[thing]))
    in_hand = [thing for thing in THINGS if values[FactKey(AT, thing)] == "hsr"]
    values[FactKey(HOLDING, "hsr")] = draw(st.sampled_from((*in_hand, "nothing")))
    for thing in ("box", "drawer"):
        values[FactKey(IS_OPEN, thing)] = draw(st.booleans())
    return world, values


@reaches("true", "false", "reachable", "not reachable", "aboard", "innermost")
@settings(max_examples=200, deadline=None)
@given(states(), st.booleans())
def test_a_node_holds_where_the_model_says_so(
    reached: Reached, drawn: tuple[WorldModel, dict[FactKey, Value]], drives: bool
) -> None:
    world, values = drawn
    domains: dict[FactKey, tuple[Value, ...]] = {
        **{FactKey(AT, thing): CARRIERS[thing] for thing in THINGS},
        FactKey(HOLDING, "hsr"): (*THINGS, "nothing"),
        **{FactKey(IS_OPEN, thing): (True, False) for thing in ("box", "drawer")},
    }
    free = ("locobot",) if drives else ()
    nodes = Nodes(world, values, free, domains, (), Travel(world, values))
    for key, names in domains.items():
        for value in names:
            nodes.fact(nodes.number[key], value)
    conditions = Conditions(nodes)
    wanted = [
        *(Literal(FactKey(AT, t), w) for t, w in product(THINGS, ("kitchen", "hallway", "box"))),
        *(Literal(FactKey(REACHABLE, thing), True) for thing in THINGS),
    ]
    for literal, aboard in product(wanted, (False, True)):
        node = conditions.literal(literal, aboard=aboard, innermost=False)
        holds = derived.holds(literal, values.get, world, aboard=aboard)
        assert _holds_as_it_is(node, nodes, values) is holds, (literal, aboard)
        reached[str(holds).lower()] += 1
        if literal.variable.relation == REACHABLE:
            reached["reachable" if holds else "not reachable"] += 1
        else:
            reached["aboard"] += aboard and holds
    for thing, place in product(THINGS, ("kitchen", "hallway")):
        node = conditions.literal(Literal(FactKey(AT, thing), place), aboard=False, innermost=True)
        chain = derived.carriers(thing, values.get, world)
        holds = next((name for name in chain if name in world.places), None) == place
        assert _holds_as_it_is(node, nodes, values) is holds, (thing, place)
        reached["innermost"] += holds


def _holds_as_it_is(node: int | bool, nodes: Nodes, values: dict[FactKey, Value]) -> bool:
    """Whether it holds in the first state, with robots that can drive where they are."""
    if isinstance(node, bool):
        return node
    return any(
        all(values[FactKey(AT, robot)] == place for robot, place in stands)
        for stands in nodes.stands_for(node, nodes.initial)
    )
