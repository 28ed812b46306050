"""What follows from what carries a thing directly."""

from __future__ import annotations

import pytest

from fleet.core.model.derived import holds, read_by, written
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import (
    AT,
    BLOCKED_BY,
    HOLDING,
    IS_OPEN,
    FactKey,
    Literal,
    Value,
    parse_literal,
)
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object, Place


def thing(name: str, *features: str, part_of: str | None = None, **more: object) -> Object:
    kind = name.split("_")[0]
    return Object(object=name, kind=kind, label=name, features=features, part_of=part_of, **more)


WORLD = WorldModel(
    skills={},
    places={
        "flat": Place(place="flat", label="Flat"),
        "kitchen": Place(place="kitchen", label="Kitchen", part_of="flat"),
        "hallway": Place(place="hallway", label="Hallway", part_of="flat"),
    },
    objects={
        o.object: o
        for o in (
            thing("fork"),
            thing("cup"),
            thing("bowl", "contains"),
            thing("table", "supports", movable=False),
            thing("cabinet", "supports", movable=False),
            thing("drawer", "contains", "openable", part_of="cabinet"),
            thing("lower", "contains", "openable", part_of="cabinet", blocked_by=("drawer",)),
            thing("oven", "openable", "supports", movable=False, home="kitchen"),
            thing("anna", "person", movable=False),
        )
    },
    robots={
        "arm": RobotSpec(robot="arm", model="arm", skills=(), capabilities={"grip": 1.0}),
        "cart": RobotSpec(robot="cart", model="cart", skills=(), capabilities={"basket": 2.0}),
    },
)  # fmt: skip

FACTS: dict[FactKey, Value] = {
    FactKey(AT, "table"): "kitchen",
    FactKey(AT, "cabinet"): "kitchen",
    FactKey(AT, "bowl"): "table",
    FactKey(AT, "fork"): "bowl",
    FactKey(AT, "cup"): "drawer",
    FactKey(AT, "anna"): "hallway",
    FactKey(AT, "arm"): "kitchen",
    FactKey(AT, "cart"): "hallway",
}


def said(text: str) -> Literal:
    literal = parse_literal(text)
    assert literal is not None
    return literal


def true(text: str, aboard: bool = False, **changes: Value) -> bool:
    """Whether it holds; `changes` are `at` facts, or `holding_arm=…`, `is_open_drawer=…`."""
    facts = dict(FACTS)
    for name, value in changes.items():
        for relation in (HOLDING, IS_OPEN, BLOCKED_BY):
            if name.startswith(relation):
                facts[FactKey(relation, name.removeprefix(relation + "_"))] = value
                break
        else:
            facts[FactKey(AT, name)] = value
    return holds(said(text), facts.get, WORLD, aboard=aboard)


@pytest.mark.parametrize("where", ["bowl", "table", "kitchen", "flat"])
def test_a_thing_is_at_all_that_carries_it(where):
    assert true(f"at(fork) = {where}")
    assert not true(f"at(fork) = {where}", fork="hallway") or where == "flat"


def test_what_is_in_a_bowl_follows_the_bowl():
    assert true("at(fork) = hallway", bowl="hallway")
    assert not true("at(fork) = kitchen", bowl="hallway")


def test_on_and_in_say_what_carries_it_directly():
    assert true("on(bowl) = table") and not true("on(fork) = table")
    assert true("in(fork) = bowl") and not true("on(fork) = bowl")
    assert not true("in(bowl) = table")


def test_what_is_in_a_part_is_in_the_whole_and_not_on_it():
    assert true("in(cup) = drawer") and true("in(cup) = cabinet")
    assert not true("on(cup) = cabinet")
    assert true("at(cup) = cabinet") and true("at(drawer) = kitchen")


def test_nothing_that_is_in_a_hand_is_at_a_place():
    for aboard in (False, True):
        assert not true("at(cup) = kitchen", aboard, cup="arm", holding_arm="cup")
        assert true("at(cup) = arm", aboard, cup="arm", holding_arm="cup")
        assert not true("at(cup) = hallway", aboard, cup="anna")
        assert not true("at(fork) = kitchen", aboard, bowl="arm", holding_arm="bowl")


def test_a_basket_is_where_the_robot_is_for_goals_only():
    assert true("at(fork) = hallway", aboard=True, bowl="cart")
    assert true("in(fork) = bowl", aboard=True, bowl="cart")
    assert not true("at(fork) = hallway", bowl="cart")


def test_what_is_in_something_closed_cannot_be_reached():
    assert true("reachable(cup) = false") and not true("reachable(cup) = true")
    assert true("reachable(cup) = true", is_open_drawer=True)
    assert true("reachable(cup) = false", is_open_drawer=False)
    assert true("reachable(drawer) = true") and true("reachable(fork) = true")
    assert true("reachable(fork) = false", bowl="drawer")


def test_what_is_behind_something_open_cannot_be_reached():
    assert true("reachable(lower) = true") and true("reachable(lower) = true", is_open_drawer=False)
    assert true("reachable(lower) = false", is_open_drawer=True)
    both = {"is_open_drawer": True, "is_open_lower": True}
    assert true("reachable(cup) = false", cup="lower", **both)
    assert true("reachable(cup) = true", cup="drawer", **both)
    assert true("reachable(drawer) = true", **both)


def test_what_somebody_found_in_the_way_is_so_while_it_is_open():
    found = {"blocked_by_cabinet": "oven"}
    assert true("reachable(cup) = true", cup="cabinet", is_open_oven=True)
    assert true("reachable(cup) = false", cup="cabinet", is_open_oven=True, **found)
    assert true("reachable(cup) = true", cup="cabinet", is_open_oven=False, **found)
    # What is in the way at its top is not at its drawers, and nothing is in its own way.
    assert true("reachable(cup) = true", is_open_drawer=True, is_open_oven=True, **found)
    own = {"blocked_by_cabinet": "drawer"}
    assert true("reachable(drawer) = true", is_open_drawer=True, **own)


def test_located_and_held():
    assert true("located(fork) = true") and true("located(fork) = false", fork=None)
    assert true("held(fork) = true", fork="arm", holding_arm="fork")
    assert true("held(fork) = false", fork="cart")


def test_a_circle_of_carriers_ends():
    assert not true("at(bowl) = kitchen", bowl="fork")


def test_on_a_thing_is_written_where_the_thing_is():
    assert written(said("on(cup) = table"), WORLD) == said("at(cup) = table")
    assert written(said("in(cup) = cart"), WORLD) == said("at(cup) = cart")
    for other in (
        "on(cup) = floor",
        "on(cup) = side_table",
        "at(cup) = table",
        "on(cup) = unknown",
    ):
        assert written(said(other), WORLD) == said(other)


def test_what_a_literal_may_read():
    values = {FactKey(AT, "fork"): {"bowl", "kitchen"}, FactKey(AT, "bowl"): {"table", "?a1"}}

    def read(text: str, aboard: bool = False) -> set[str]:
        found = read_by(said(text), lambda key: values.get(key, set()), WORLD, aboard=aboard)
        return {str(key) for key in found}

    assert read("at(fork) = kitchen") == {"at(fork)", "at(bowl)", "at(table)"}
    assert read("at(fork) = kitchen", aboard=True) == {
        "at(fork)", "at(bowl)", "at(table)", "holding(?a1)", "at(?a1)"
    }  # fmt: skip
    assert read("in(fork) = bowl") == {"at(fork)"}
    assert read("at(drawer) = kitchen") == {"at(cabinet)"}
    values[FactKey(AT, "bowl")] = {"drawer"}
    assert "is_open(drawer)" in read("reachable(fork) = true")
    assert read("on(cup) = floor") == {"on(cup)"}


def test_of_facts_about_one_thing_the_newest_counts():
    def at(cup: str, relation: str, value: str, time_s: float) -> Fact:
        return Fact(subject=cup, relation=relation, value=value, source="arm", time_s=time_s)

    facts = [
        at("cup", "on", "table", 2.0),
        at("cup", "at", "hallway", 1.0),
        at("fork", "on", "table", 1.0),
        at("fork", "at", "hallway", 2.0),
        at("bowl", "on", "table", 3.0),
        at("bowl", "at", "kitchen", 3.0),
    ]
    world = WorldModel.of(
        {}, WORLD.places.values(), WORLD.objects.values(), WORLD.robots.values(), facts
    )
    assert dict(world.facts) == {
        FactKey(AT, "cup"): "table",
        FactKey(AT, "fork"): "hallway",
        FactKey(AT, "bowl"): "table",
    }
