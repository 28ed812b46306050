"""Sentences to conditions and facts."""

from __future__ import annotations

import pytest

from fleet.core.language import Vocabulary, goal_conditions, statement_facts
from fleet.errors import NotUnderstood
from keyexpr_schema.world import Object, Place
from tests.household import carrier, cup, manipulator

WORDS = Vocabulary(
    places={
        "kitchen": Place(place="kitchen", label="Kitchen", aliases=("cooking area",)),
        "living_room": Place(place="living_room", label="Living room", aliases=("lounge",)),
        "hallway": Place(place="hallway", label="Hallway"),
    },
    objects={
        "cup_1": cup(1),
        "cup_2": cup(2),
        "book": Object(object="book", kind="book", label="Red book"),
    },
    robots={"hsr": manipulator(), "locobot": carrier()},
)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Bring the first cup to the hallway", ["at(cup_1) = hallway"]),
        ("Please take cup 2 into the living room.", ["at(cup_2) = living_room"]),
        ("deliver the second cup to the lounge!", ["at(cup_2) = living_room"]),
        ("put the book in the cooking area", ["at(book) = kitchen"]),
        ("Move the red book to living_room", ["at(book) = living_room"]),
        ("Bring both cups to the hallway", ["at(cup_1) = hallway", "at(cup_2) = hallway"]),
        (
            "Bring the first cup to the hallway and the second cup to the living room",
            ["at(cup_1) = hallway", "at(cup_2) = living_room"],
        ),
        ("Send the locobot to the kitchen", ["at(locobot) = kitchen"]),
        ("hsr, go to the hallway", ["at(hsr) = hallway"]),
    ],
)
def test_goals_are_understood(text: str, expected: list[str]) -> None:
    assert [str(condition) for condition in goal_conditions(text, WORDS)] == expected


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("Bring the third cup to the hallway", "known are book, cup_1, cup_2"),
        ("Bring the cup to the hallway", "could be cup_1 or cup_2"),
        ("Bring the first cup to the attic", "known are hallway, kitchen, living_room"),
        ("Sing a song", "not understood as a goal"),
        ("", "empty"),
        ("...", "empty"),
        ("Bring the first cup to the hallway and dance", "not understood as a goal"),
        ("Bring cup 1 to the hallway and cup 1 to the kitchen", "in two places"),
    ],
)
def test_what_is_not_understood_is_refused_with_the_choices(text: str, says: str) -> None:
    with pytest.raises(NotUnderstood, match=says):
        goal_conditions(text, WORDS)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("The first cup is in the kitchen.", [("at", "cup_1", "kitchen")]),
        ("There is the red book on the lounge", [("at", "book", "living_room")]),
        ("Both cups are in the hallway", [("at", "cup_1", "hallway"), ("at", "cup_2", "hallway")]),
        ("The HSR is at the kitchen", [("at", "hsr", "kitchen")]),
    ],
)
def test_statements_become_facts(text: str, expected: list[tuple[str, str, str]]) -> None:
    assert list(statement_facts(text, WORDS)) == expected


def test_a_statement_about_nothing_known_is_refused() -> None:
    with pytest.raises(NotUnderstood, match="known are"):
        statement_facts("The dragon is in the kitchen", WORDS)
