"""What stands before a clause means what it means behind it, and goes for what follows."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fleet.errors import NotUnderstood
from fleet.language import Vocabulary, read
from tests.support.language_flat import FURNISHED, thing
from tests.support.language_flat_said import SPOKEN, told

HALL_WINDOW = thing("hall_window", "openable", movable=False)
KITCHEN_WINDOW = thing("kitchen_window", "openable", movable=False)
CEILING_LAMP = thing("hall_lamp", "switchable", movable=False)
TWO_OF_A_KIND = replace(
    SPOKEN,
    objects={
        **SPOKEN.objects,
        "hall_window": HALL_WINDOW,
        "hall_lamp": CEILING_LAMP,
        "kitchen_window": KITCHEN_WINDOW,
    },
    carriers={
        **SPOKEN.carriers,
        "hall_window": ("hallway",),
        "hall_lamp": ("hallway",),
        "kitchen_window": ("kitchen",),
    },
    whereabouts={
        **SPOKEN.whereabouts,
        "hall_window": "hallway",
        "hall_lamp": "hallway",
        "kitchen_window": "kitchen",
    },
)


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("In the kitchen, close all cupboards", "is_open(cupboard) = false"),
        ("In the hallway close the window", "is_open(hall_window) = false"),
        ("On the kitchen table, put the fork", "on(fork) = kitchen_table"),
        ("From the kitchen, bring the first cup to the hallway", "at(cup_1) = hallway"),
        ("To the hallway, take the fork", "at(fork) = hallway"),
        ("For Anna, get the fork", "at(fork) = anna"),
        ("In the hallway, look for the fork", "searched(hallway) = true and located(fork) = true"),
        ("In the hallway, close the window and turn off all lamps",
         "is_open(hall_window) = false and is_on(hall_lamp) = false"),
        ("In the hallway, turn on all lamps and open the window",
         "is_on(hall_lamp) = true and is_open(hall_window) = true"),
        ("In the hallway, all lamps should be off", "is_on(hall_lamp) = false"),
        ("Go to the kitchen. In the hallway, close the window. Turn off the television.",
         "at(hsr or locobot) = kitchen, then is_open(hall_window) = false and "
         "is_on(television) = false"),
    ],
)  # fmt: skip
def test_it_is_read_as_behind_the_clause(text: str, meant: str) -> None:
    assert told(read(text, TWO_OF_A_KIND)) == meant


def test_where_it_is_counts_more_than_where_somebody_was_sent() -> None:
    said = "Go to the kitchen. Close the window in the hallway."
    assert told(read(said, TWO_OF_A_KIND)).endswith("is_open(hall_window) = false")


@pytest.mark.parametrize(
    ("text", "words", "says"),
    [
        ("With the fork, open the fridge", FURNISHED, "'With the fork': nothing can be named"),
        ("Use the fork to open the fridge", FURNISHED, "'Use the fork': nothing can be named"),
        ("To the hallway, the lamp should be off", FURNISHED, "'[Tt]o the hallway'"),
    ],
)
def test_what_says_nothing_of_the_clause_is_refused(
    text: str, words: Vocabulary, says: str
) -> None:
    with pytest.raises(NotUnderstood, match=says):
        read(text, words)
