"""Statements: the facts in them, and those that are refused."""

from __future__ import annotations

import pytest

from fleet.errors import NotUnderstood
from fleet.language import statement_facts
from keyexpr_schema.facts import Value
from tests.support.language_house import WORDS


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("The first cup is in the kitchen.", [("at", "cup_1", "kitchen")]),
        ("There is the red book on the lounge", [("at", "book", "living_room")]),
        ("Both cups are in the hallway", [("at", "cup_1", "hallway"), ("at", "cup_2", "hallway")]),
        ("The HSR is at the kitchen", [("at", "hsr", "kitchen")]),
        (
            "There are two cups in the kitchen",
            [("at", "cup_1", "kitchen"), ("at", "cup_2", "kitchen")],
        ),
        (
            "Cups 1 and 2 are on the kitchen table",
            [
                ("at", "cup_1", "kitchen"),
                ("on", "cup_1", "kitchen_table"),
                ("at", "cup_2", "kitchen"),
                ("on", "cup_2", "kitchen_table"),
            ],
        ),
        ("Nobody knows where the book is", [("at", "book", None)]),
        ("It is unknown where the book is.", [("at", "book", None)]),
        ("The book is lost", [("at", "book", None)]),
        ("the kitchen has been searched", [("searched", "kitchen", True)]),
        ("the kitchen has not been searched", [("searched", "kitchen", False)]),
        ("The HSR is holding the first cup", [("holding", "hsr", "cup_1"), ("at", "cup_1", "hsr")]),
        ("The HSR has the book", [("at", "book", "hsr")]),
        ("the locobot carries both cups", [("at", "cup_1", "locobot"), ("at", "cup_2", "locobot")]),
        ("The book is in the locobot's basket", [("at", "book", "locobot")]),
        ("The HSR's hand is empty", [("holding", "hsr", "nothing")]),
        ("the hsr holds nothing", [("holding", "hsr", "nothing")]),
        ("The kitchen contains the book", [("at", "book", "kitchen")]),
        (
            "In the kitchen there are two cups",
            [("at", "cup_1", "kitchen"), ("at", "cup_2", "kitchen")],
        ),
        (
            "On the kitchen table is the book",
            [("at", "book", "kitchen"), ("on", "book", "kitchen_table")],
        ),
        (
            "The first cup is in the kitchen and the second cup is in the hallway",
            [("at", "cup_1", "kitchen"), ("at", "cup_2", "hallway")],
        ),
        (
            "Cup 1 is in the kitchen, the second in the hallway and the book in the living room",
            [("at", "cup_1", "kitchen"), ("at", "cup_2", "hallway"), ("at", "book", "living_room")],
        ),
        ("The book could be anywhere", [("at", "book", None)]),
        ("I put the book in the kitchen", [("at", "book", "kitchen")]),
        ("I saw the hsr in the hallway", [("at", "hsr", "hallway")]),
        (
            "We have searched all rooms",
            [
                ("searched", "hallway", True),
                ("searched", "kitchen", True),
                ("searched", "living_room", True),
            ],
        ),
        ("I don't know where the cups are", [("at", "cup_1", None), ("at", "cup_2", None)]),
        (
            "Everything is in the kitchen",
            [
                ("at", "cup_1", "kitchen"),
                ("at", "cup_2", "kitchen"),
                ("at", "book", "kitchen"),
                ("at", "fridge", "kitchen"),
            ],
        ),
        ("the book's in the kitchen", [("at", "book", "kitchen")]),
        (
            "The book is on the table in the hallway",
            [("at", "book", "hallway"), ("on", "book", "hallway_table")],
        ),
        (
            "The book is in the kitchen. It is on the kitchen table.",
            [("at", "book", "kitchen"), ("on", "book", "kitchen_table")],
        ),
        ("The book can be found in the kitchen", [("at", "book", "kitchen")]),
        ("The book's location is unknown", [("at", "book", None)]),
        ("cup 1 in kitchen", [("at", "cup_1", "kitchen")]),
        ("The fridge is in the kitchen", [("at", "fridge", "kitchen")]),
        (
            "all rooms have been searched",
            [
                ("searched", "hallway", True),
                ("searched", "kitchen", True),
                ("searched", "living_room", True),
            ],
        ),
        ("nobody has searched the kitchen", [("searched", "kitchen", False)]),
        ("the location of the book is unknown", [("at", "book", None)]),
        ("The book is located in the kitchen now", [("at", "book", "kitchen")]),
        (
            "every room was searched",
            [
                ("searched", "hallway", True),
                ("searched", "kitchen", True),
                ("searched", "living_room", True),
            ],
        ),
        ("the kitchen was not searched", [("searched", "kitchen", False)]),
        (
            "I left the first cup on the coffee table",
            [("at", "cup_1", "living_room"), ("on", "cup_1", "coffee_table")],
        ),
        (
            "the HSR and the locobot are in the hallway",
            [("at", "hsr", "hallway"), ("at", "locobot", "hallway")],
        ),
    ],
)
def test_statements_become_facts(text: str, expected: list[tuple[str, str, Value]]) -> None:
    assert [(*key, value) for key, value in statement_facts(text, WORDS)] == expected


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "the sentence is empty"),
        ("There are three cups in the kitchen", "'three cups': there are only 2"),
        (
            "There is a cup in the kitchen",
            "'There is a cup in the kitchen' does not say which of cup_1 or cup_2: name it",
        ),
        (
            "The first cup is not in the kitchen",
            "'The first cup is not in the kitchen' says what is not so",
        ),
        (
            "The first cup isn't in the kitchen",
            '"The first cup isn\'t in the kitchen" says what is not so',
        ),
        ("The dragon is in the kitchen", "'The dragon' is not a known object, robot or place"),
        (
            "The cup is in the kitchen or the hallway",
            "'or' leaves a choice that cannot be left open",
        ),
        ("The book was in the kitchen", "'was' tells of the past"),
        ("The book might be in the kitchen", "'might' is uncertain"),
        (
            "The book is in the kitchen and the book is in the hallway",
            "it says two things of at(book): kitchen and hallway",
        ),
        (
            "The book belongs in the kitchen",
            "'The book belongs in the kitchen' is not understood as a fact",
        ),
        (
            "Bring the book to the kitchen",
            "'Bring' says what to do and not what is so",
        ),
        ("the book is", "'the book is' is not understood as a fact"),
        ("The weather is nice", "'The weather' is not a known object, robot or place"),
        (
            "If the book is in the kitchen",
            "'If' makes it depend on something else, which a fact cannot",
        ),
        (
            "there are cups in the kitchen",
            "'cups' does not say how many: say all of them or which ones",
        ),
        ("no cups are in the kitchen", "'no' says what must not be, or leaves something out"),
        ("the book is in the kitchen at 5 pm", "'pm' names a time, which a fact cannot"),
        (
            "every room was not searched",
            "'every room was not searched' could mean all or some of them",
        ),
        ("The book is home", "'The book is home' is not understood as a fact"),
        ("the locobot is on the hsr", "a robot is at a place, not on a robot: name the place"),
        *(
            (text, f'{text!r} is not understood as a fact: say it like "the first cup is in')
            for text in ("blah", "blah blah", "the kitchen", "the book", "what")
        ),
    ],
)
def test_statements_that_are_refused(text: str, says: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        statement_facts(text, WORDS)
    assert says in str(refused.value)
