"""What is told of the world is held against what skill files declare of relations."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fleet.core import events
from fleet.core.model.declarations import misfit, relations_of
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import FactKey, Literal, Value
from keyexpr_schema.payloads.goals import Condition, GoalState, Precedence
from keyexpr_schema.payloads.world import Object, Statement
from tests.support.fleet_model import FleetModel
from tests.support.household import PLACES, SKILLS, at, bring, manipulator

OWN = skills_from_data(
    {
        "relations": {
            "temperature": {"of": "food", "values": ["hot", "cold"]},
            "level": {"of": "jug | cup", "values": "number"},
            "shown_in": {"of": "food", "values": "place"},
        },
        "skills": {
            "heat": {
                "parameters": {"robot": "robot", "thing": "food", "place": "place", "jug": "jug"},
                "after": [
                    "temperature(thing) = hot",
                    "level(jug) += 1",
                    "shown_in(thing) = place",
                ],
            }
        },
    },
    "here",
)
SOUP = Object(object="soup", kind="soup", label="soup", features=("food",))
DOOR = Object(object="fridge", kind="fridge", label="fridge", features=("openable", "contains"))
JUG = Object(object="jug", kind="jug", label="jug")
WORLD = WorldModel.of({**SKILLS, **OWN}, PLACES, (SOUP, DOOR, JUG), (manipulator(),), ())


@pytest.mark.parametrize(
    ("relation", "subject", "value", "sentence"),
    [
        ("is_open", "fridge", True, None),
        ("is_open", "fridge", None, None),
        ("temperature", "soup", "cold", None),
        ("level", "jug", 1.5, None),
        ("shown_in", "soup", "kitchen", None),
        ("undeclared", "soup", "whatever", None),
        ("is_open", "soup", True, "is_open is said of openable, and soup is none"),
        ("is_open", "fridge", "ajar", "is_open is true or false, not ajar"),
        ("temperature", "soup", "warm", "temperature is hot or cold, not warm"),
        ("level", "jug", "full", "level is a number, not full"),
        ("level", "jug", True, "level is a number, not true"),
        ("level", "hsr", 1, "level is said of jug | cup, and hsr is not that"),
        ("shown_in", "soup", "jug", "shown_in is a place, not jug"),
    ],
)
def test_subjects_and_values_are_those_that_are_declared(
    relation: str, subject: str, value: Value, sentence: str | None
) -> None:
    literal = Literal(FactKey(relation, subject), value)
    assert misfit(literal, WORLD) == (None if sentence is None else f"{literal}: {sentence}")


def test_known_relations_are_those_that_somebody_speaks_of() -> None:
    known = relations_of(WORLD.with_facts({FactKey("dusty", "soup"): True}))
    assert {"at", "held", "reachable", "is_open", "temperature", "level", "dusty"} <= known
    assert "is_opn" not in known


def model() -> FleetModel:
    made = FleetModel((manipulator(),), cups=2, skills={**SKILLS, **OWN})
    for thing in (SOUP, DOOR, JUG):
        made.receive(events.ObjectPut, object=thing)
    return made


@pytest.mark.parametrize(
    ("condition", "sentence"),
    [
        (at("vase", "hallway"), "'vase' is nothing that is known"),
        (at("cup_2", "attic"), "'attic' is nothing that is known"),
        (
            Condition(relation="is_opn", subject="fridge", value=True),
            "is_opn(fridge) = true: 'is_opn' is no relation that skills or facts speak of; those",
        ),
        (
            Condition(relation="is_open", subject="cup_2", value=True),
            "is_open(cup_2) = true: is_open is said of openable, and cup_2 is none",
        ),
        (
            Condition(relation="temperature", subject="soup", value=3),
            "temperature(soup) = 3: temperature is hot or cold, not 3",
        ),
    ],
)
def test_a_goal_that_keeps_or_avoids_what_there_is_not_is_rejected(
    condition: Condition, sentence: str
) -> None:
    in_order = Precedence(first=at("cup_2", "hallway"), then=condition)
    for more in (
        {"always": (condition,)},
        {"never": (condition,)},
        {"sometime_before": (in_order,)},
        {"sometime_before": (Precedence(first=in_order.then, then=in_order.first),)},
    ):
        made = model()
        made.receive(events.GoalPut, goal=replace(bring(1, "hallway"), **more))
        assert made.goal_state("g1") is GoalState.REJECTED
        assert sentence in (made.goal_states["g1"].reason or "")


def test_a_goal_for_which_no_such_value_is_declared_is_rejected() -> None:
    wrong = Condition(relation="is_open", subject="fridge", value="ajar")
    made = model()
    made.receive(events.GoalPut, goal=replace(bring(1, "hallway"), conditions=(wrong,)))
    assert made.goal_states["g1"].reason == (
        "is_open(fridge) = ajar: is_open is true or false, not ajar"
    )


def test_a_statement_that_says_what_cannot_be_is_not_believed() -> None:
    made = model()
    said = Statement(statement="s", text="The soup is open.")
    made.receive(events.StatementPut, statement=said)
    assert made.state.fact("is_open", "soup") is None
    assert made.state.statement_states["s"].reason is not None
