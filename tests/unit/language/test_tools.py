"""A tool that is named is wanted, or refused by name: it is never left out in silence."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.skills import phrases_of
from fleet.errors import NotUnderstood
from fleet.language import Vocabulary, read
from tests.support.language_flat import FURNISHED, thing
from tests.support.language_flat_said import SPOKEN, told

KNIVES = (
    thing("bread_knife", categories=("blade",)),
    thing("butter_knife", categories=("blade",)),
    thing("bread", "sliceable", movable=True),
)


def kitchen(*effects: str, knives: int = 2) -> Vocabulary:
    """The flat with bread, knives and a skill that slices."""
    skills = skills_from_data(
        {
            "relations": {
                "sliced": {"of": "sliceable", "values": "bool"},
                "sliced_with": {"of": "sliceable", "values": "object"},
            },
            "skills": {
                "slice": {
                    "about": "Cut food into slices.",
                    "says": ["slice {food} [with {tool}]"],
                    "parameters": {"robot": "robot", "food": "sliceable", "tool": "blade"},
                    "before": ["holding(robot) = tool"],
                    "after": ["sliced(food) = true", *effects],
                    "duration_s": 20,
                }
            },
        },
        "slicing.yaml",
    )
    things = {each.object: each for each in (*KNIVES[:knives], KNIVES[2])}
    phrases = (*FURNISHED.skill_phrases, *phrases_of(skills))
    return replace(FURNISHED, objects={**FURNISHED.objects, **things}, skill_phrases=phrases)


TELLS = kitchen("sliced_with(food) = tool")


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("Slice the bread with the butter knife",
         "sliced(bread) = true and sliced_with(bread) = butter_knife"),
        ("Slice the bread with a blade", "sliced(bread) = true"),
        ("Slice the bread", "sliced(bread) = true"),
    ],
)  # fmt: skip
def test_it_is_wanted_where_an_effect_names_it(text: str, meant: str) -> None:
    assert told(read(text, TELLS)) == meant


@pytest.mark.parametrize(
    ("text", "words", "says"),
    [
        ("Slice the bread with the butter knife", kitchen(),
         r"'with the butter knife': no effect of 'slice' says"),
        ("Slice the bread with the fork", TELLS,
         r"fork is nothing to slice with; known are bread_knife, butter_knife"),
        ("Slice the bread with the bread knife and the butter knife", TELLS, "say which"),
        ("Open the fridge with the fork", TELLS, "'with the fork': nothing can be named with"),
        ("Vacuum the hallway with the fork", SPOKEN, "'with the fork': nothing can be named with"),
        ("Vacuum the hallway for Anna's sake", SPOKEN, "sake"),
        ("Vacuum the hallway on the shelf", SPOKEN, "'on the shelf' is not understood after"),
        ("Search the kitchen with the fork", TELLS, "'with the fork'|'with' says how"),
    ],
)  # fmt: skip
def test_it_is_refused_by_name_where_another_may_be_taken(
    text: str, words: Vocabulary, says: str
) -> None:
    with pytest.raises(NotUnderstood, match=says):
        read(text, words)


def test_the_only_one_there_is_goes_without_saying() -> None:
    assert told(read("Slice the bread with the bread knife", kitchen(knives=1))) == (
        "sliced(bread) = true"
    )
