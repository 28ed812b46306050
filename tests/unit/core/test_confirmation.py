"""Which readings are coarse: what could not be undone, and what nobody has spoken of."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fleet.core.confirmation import is_coarse
from fleet.core.model.skill_file import skills_from_data
from fleet.core.state import State
from fleet.core.table import Table
from fleet.language import Reading, WantedGoal
from keyexpr_schema.facts import FactKey, Literal
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.world import Object, Place
from keyexpr_schema.yaml_reader import parsed_yaml
from tests.support.household import SKILLS

KITCHEN_SKILLS = """
relations:
  sliced: {of: object, values: bool}
  is_open: {of: object, values: bool}
skills:
  slice:
    parameters: {robot: robot, food: object}
    before: []
    after: [sliced(food) = true]
    duration_s: 5
  open:
    parameters: {robot: robot, thing: object}
    before: []
    after: [is_open(thing) = true]
    duration_s: 5
  close:
    parameters: {robot: robot, thing: object}
    before: []
    after: [is_open(thing) = false]
    duration_s: 5
"""
STATE = State(
    skills={
        **SKILLS,
        **skills_from_data(parsed_yaml(KITCHEN_SKILLS, ValueError, "here"), "kitchen"),
    },
    objects=Table(
        {
            name: Object(object=name, kind=name, label=label)
            for name, label in (("apple", "the red apple"), ("box", "toolbox"), ("anna", "Anna"))
        }
    ),
    places=Table({"kitchen": Place(place="kitchen", label="kitchen")}),
)


def wants(relation: str, subject: str, value: str | bool = True) -> Condition:
    return Condition(relation=relation, subject=subject, value=value)


@pytest.mark.parametrize(
    ("text", "wanted", "coarse"),
    [
        ("do the box", [wants("is_open", "box")], False),
        ("do the apples", [wants("sliced", "apple")], True),  # nothing makes it whole again
        ("do the apple in the kitchen", [wants("at", "apple", "kitchen")], False),
        ("do the red one in the kitchen", [wants("at", "apple", "kitchen")], False),
        ("do the thing in the kitchen", [wants("at", "apple", "kitchen")], True),
        ("do the apple", [wants("at", "apple", "anna")], False),  # who speaks need not be named
        ("do the apple", [wants("at", "apple", "box")], True),
        ("do the apple and box", [wants("at", "apple", "kitchen")] * 4, True),
        ("the apple and the box, kitchen", [wants("at", "apple", "kitchen")], True),  # one is lost
        ("the apple, kitchen, box", [wants("on", "apple", "box")], True),
        ("don't you dare do the box", [wants("is_open", "box")], True),
        ("do the box in ten minutes", [wants("is_open", "box")], True),
        ("do the box unless it rains", [wants("is_open", "box")], True),
    ],
)
def test_coarse(text: str, wanted: list[Condition], coarse: bool) -> None:
    goal = Goal(goal="g", text=text, speaker="anna")
    reading = Reading(text, (WantedGoal((tuple(wanted),)),))
    assert is_coarse(STATE, goal, reading) is coarse


def test_what_is_told_along_or_done_again_and_again_is_coarse() -> None:
    goal = Goal(goal="g", text="do the box")
    wanted = WantedGoal(((wants("is_open", "box"),),))
    assert not is_coarse(STATE, goal, Reading("", (wanted,)))
    assert is_coarse(STATE, goal, Reading("", (replace(wanted, every="PT2H"),)))
    told = (Literal(FactKey("at", "box"), "kitchen"),)
    assert is_coarse(STATE, goal, Reading("", (wanted,), told))
    many = replace(wanted, never=(wants("is_open", "apple"),))
    assert is_coarse(STATE, goal, Reading("", (many,)))
