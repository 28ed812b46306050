"""What reading costs, counted in calls: linear in the length, and little where it is too long."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import suppress
from types import FrameType

import pytest

from benchmarks.language.reader import vocabulary_of
from fleet.errors import NotUnderstood
from fleet.language import Reading, Vocabulary, read
from fleet.language.reader import MOST_FORKS, Reader
from keyexpr_schema.payloads.world import Object, Place
from tests.support.household import carrier, manipulator

THINGS = [f"{colour} {kind}" for kind in ("cup", "plate", "book", "ball") for colour in
          ("red", "blue", "green", "white", "black", "grey", "pink", "brown")]  # fmt: skip
PLACES = ("kitchen", "hallway", "study", "attic")
WORDS = Vocabulary(
    places={name: Place(place=name, label=name) for name in PLACES},
    objects={
        name: Object(object=name, kind=name.split("_")[1], label=name)
        for name in (thing.replace(" ", "_") for thing in THINGS)
    },
    robots={"hsr": manipulator(), "locobot": carrier()},
)


def listed(count: int) -> str:
    return (
        f"bring the {', the '.join(THINGS[: count - 1])} and the {THINGS[count - 1]} to the attic"
    )


def one_by_one(count: int) -> str:
    return " and ".join(f"bring the {thing} to the attic" for thing in THINGS[:count])


def each_to_its_place(count: int) -> str:
    pairs = [f"the {thing} in the {PLACES[i % 4]}" for i, thing in enumerate(THINGS[:count])]
    return f"put {', '.join(pairs)}"


def calls_of(text: str) -> int:
    """How many functions are called to read it."""
    with suppress(NotUnderstood):
        read(text, WORDS)  # so that what is found out once is known
    calls = 0

    def count(frame: FrameType, event: str, arg: object) -> None:
        nonlocal calls
        calls += event == "call"

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        with suppress(NotUnderstood):
            read(text, WORDS)
    finally:
        sys.setprofile(before)
    return calls


@pytest.mark.parametrize("say", [listed, one_by_one, each_to_its_place])
def test_reading_is_linear_in_the_length(say: Callable[[int], str]) -> None:
    reading = read(say(20), WORDS)
    assert isinstance(reading, Reading)
    assert len(reading.stages[0]) == 20
    some, twice, four_times = (calls_of(say(count)) for count in (5, 10, 20))
    assert four_times - twice < 2.5 * (twice - some)


def test_a_list_of_many_things_is_one_clause() -> None:
    reading = read(f"bring {' and '.join(f'the {thing}' for thing in THINGS)} to the attic", WORDS)
    assert isinstance(reading, Reading)
    assert len(reading.stages[0]) == len(THINGS)


def test_a_sentence_of_thirty_words_costs_little() -> None:
    text = each_to_its_place(5)
    assert len(text.split()) > 30
    reading = read(text, WORDS)
    assert isinstance(reading, Reading)
    assert len(reading.stages[0]) == 5
    assert calls_of(text) < 40_000


@pytest.mark.parametrize(
    "text", ["x " * 100_000, "a" * 120_000, "bring the red cup to the attic and " * 20_000]
)
def test_a_text_that_is_too_long_costs_nothing(text: str) -> None:
    with pytest.raises(NotUnderstood, match="at most 8,000 are read"):
        read(text, WORDS)
    assert calls_of(text) < 10


def test_a_sentence_that_leaves_very_much_open_is_refused_and_not_tried_through() -> None:
    text = "bring me the mug" + " and the mug" * 12
    reader = Reader(text, vocabulary_of("house"))
    with pytest.raises(NotUnderstood, match="the mug' could be"):
        reader.read(None)
    assert reader.forks <= MOST_FORKS + 1


def test_a_refusal_does_not_say_a_long_text_again() -> None:
    with pytest.raises(NotUnderstood) as refused:
        read("frobnicate" * 700, vocabulary_of("house"))
    assert len(str(refused.value)) < 500
