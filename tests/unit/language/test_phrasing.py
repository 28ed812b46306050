"""What is understood is said back in words."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest

from benchmarks.language.reader import vocabulary_of
from fleet.language import Ambiguity, Vocabulary, read
from fleet.language.phrasing import Phrasing
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Object, Place
from tests.unit.language.test_read import SPOKEN

NOW = datetime(2026, 5, 1, 9, 30, tzinfo=UTC)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Close the fridge", "the fridge is closed"),
        ("Should the lamp be on, switch it off", "the lamp is off, if the lamp is on"),
        ("Switch on the lamp in ten minutes", "the lamp is on, in 10 min"),
        ("Switch on the lamp every day at 7", "the lamp is on, at 07:00 every day"),
        ("Switch on the lamp every two hours", "the lamp is on, every 2 hours"),
        ("Keep the fridge closed", "always: the fridge is closed"),
        ("Find the fork", "it is known where the fork is"),
        ("Search the kitchen", "the kitchen has been searched"),
        ("HSR, bring the fork to the kitchen", "the fork is in the kitchen, by hsr"),
    ],
)
def test_readings_are_said_in_words(text: str, said: str) -> None:
    reading = read(text, SPOKEN, NOW)
    assert not isinstance(reading, Ambiguity)
    assert Phrasing(SPOKEN).reading(reading) == said


@pytest.mark.parametrize(
    ("text", "world", "said"),
    [
        ("Send two robots to the office", "warehouse",
         "two of Carrier 1, Carrier 2, Forklift, Picker 1, … are in the office"),
        ("Bring me two apples and the milk", "house",
         "two of apple 1, apple 2 and apple 3 are with Anna and the milk is with Anna"),
        ("If nobody is in the kitchen, close the fridge", "house",
         "the fridge is closed, if nobody is in the kitchen"),
        ("If something is on the kitchen table, close the fridge", "house",
         "the fridge is closed, if something is on the kitchen table"),
    ],
)  # fmt: skip
def test_some_of_several_are_counted(text: str, world: str, said: str) -> None:
    words = vocabulary_of(world)
    reading = read(text, words, NOW)
    assert not isinstance(reading, Ambiguity)
    assert Phrasing(words).reading(reading) == said


def thing(name: str, label: str = "") -> Object:
    return Object(object=name, kind="cup", label=label)


WORDS = Vocabulary(
    {"den": Place(place="den", label="den")},
    {
        "mug_1": thing("mug_1", "mug"),
        "mug_2": thing("mug_2", "mug"),
        "red_cup": thing("red_cup", "red cup"),
        **{f"cup_{n}": thing(f"cup_{n}", f"cup {n}") for n in range(1, 7)},
    },
    {"hsr": RobotSpec(robot="hsr", model="hsr", skills=(), capabilities={})},
)


@pytest.mark.parametrize(
    ("relation", "subjects", "value", "said"),
    [
        ("at", ("red_cup",), "den", "the red cup is in the den"),
        ("on", ("red_cup",), "mug_1", "the red cup is on mug_1"),
        ("at", ("mug_1", "mug_2"), "hsr", "mug_1 or mug_2 is with hsr"),
        ("at", tuple(f"cup_{n}" for n in range(1, 7)), "den",
         "one of 6 things (cup 1, cup 2, cup 3, cup 4, …) is in the den"),
        ("held", ("cup_1",), True, "a robot holds cup 1"),
        ("holding", ("hsr",), "nothing", "hsr holds nothing"),
        ("is_open", ("red_cup",), False, "the red cup is not open"),
        ("temperature", ("cup_1",), "hot", "temperature of cup 1 is hot"),
        ("located", ("moon",), False, "nobody knows where moon is"),
    ],
)  # fmt: skip
def test_conditions_are_said_with_names_that_tell_things_apart(
    relation: str, subjects: tuple[str, ...], value: str | bool, said: str
) -> None:
    row = Condition(relation=relation, subject=subjects[0], any_of=subjects[1:] and subjects,
                    value=value)  # fmt: skip
    assert Phrasing(WORDS).condition(row) == said
