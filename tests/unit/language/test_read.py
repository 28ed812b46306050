"""What sentences mean besides a goal that is reached once: times, who, questions, choices."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import pytest

from fleet.errors import NotUnderstood
from fleet.language import Ambiguity, read, read_goal
from fleet.language.words.morphology import gerund, participles
from tests.support.language_flat import FURNISHED
from tests.support.language_flat_said import SPOKEN, told

NOW = datetime(2026, 3, 4, 9, 30, tzinfo=UTC)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Get me the cup in the fridge", "at(cup_2) = anna"),
        ("Bring me the cup on the kitchen table", "at(cup_1) = anna"),
        ("Bring the lamp on the coffee table to the kitchen", "at(lamp) = kitchen"),
        ("I'd like the fork", "at(fork) = anna"),
        ("Anna needs a cup", "at(cup_1 or cup_2) = anna"),
        ("Wash the cups", "clean(cup_1) = true and clean(cup_2) = true"),
        ("Rinse the first cup off", "clean(cup_1) = true"),
        ("Clean the dirty cup", "clean(cup_1) = true"),
        ("Bring a clean cup to the hallway", "at(cup_2) = hallway"),
        ("The first cup should be clean", "clean(cup_1) = true"),
        ("Bring all cups but the first one to the hallway", "at(cup_2) = hallway"),
        ("Lamp off", "is_on(lamp) = false"),
        ("That lamp on the coffee table, switch it off", "is_on(lamp) = false"),
        ("The lamp, please switch it off", "is_on(lamp) = false"),
        ("Rinse cups 1 and 2", "clean(cup_1) = true and clean(cup_2) = true"),
        ("Remove the dirty cups from the kitchen table and put them in the fridge",
         "in(cup_1) = fridge"),
        ("All the lamps in the house should be off", "is_on(lamp) = false"),
        ("Tell the hsr to close the fridge and the locobot to go to the hallway",
         "is_open(fridge) = false and at(locobot) = hallway, by hsr"),
        ("Grab me a cup", "at(cup_1 or cup_2) = anna"),
        ("Load the bowl with the fork and the lamp", "in(fork) = bowl and in(lamp) = bowl"),
        ("Stock the fridge with the cups", "in(cup_1) = fridge and in(cup_2) = fridge"),
        ("Actually, close the fridge", "is_open(fridge) = false"),
        ("Last but not least: close the fridge", "is_open(fridge) = false"),
        ("The hsr closes the fridge and then brings the fork to the hallway",
         "is_open(fridge) = false, then at(fork) = hallway, by hsr"),
        ("Put the fork in the bowl, and on the way back close the fridge",
         "in(fork) = bowl, then is_open(fridge) = false"),
        ("Make sure nobody goes to the hallway",
         "never at(hsr) = hallway, never at(locobot) = hallway"),
        ("Check if the lamp is on and if it is, switch it off",
         "is_on(lamp) = false, if is_on(lamp) = true"),
        ("Close the fridge and the lamp in the living room off",
         "is_open(fridge) = false and is_on(lamp) = false"),
        ("First close the fridge, then the cupboard",
         "is_open(fridge) = false, then is_open(cupboard) = false"),
        ("Close the fridge before you switch off the lamp",
         "is_open(fridge) = false, then is_on(lamp) = false"),
        ("After closing the fridge go to the hallway",
         "is_open(fridge) = false, then at(hsr or locobot) = hallway"),
        ("Open the fridge, put the fork inside and close it",
         "is_open(fridge) = true and in(fork) = fridge, then is_open(fridge) = false"),
        ("Put the fork into the fridge and close it",
         "in(fork) = fridge and is_open(fridge) = false"),
        ("Keep the fridge closed", "always is_open(fridge) = false"),
        ("The fridge should stay closed", "always is_open(fridge) = false"),
        ("The lamp should always be on", "always is_on(lamp) = true"),
        ("Never open the cupboard", "never is_open(cupboard) = true"),
        ("The hsr must never go to the hallway", "never at(hsr) = hallway"),
        ("Go to the hallway without entering the kitchen",
         "at(hsr or locobot) = hallway, never at(hsr) = kitchen, never at(locobot) = kitchen"),
        ("If the fridge is open, close it", "is_open(fridge) = false, if is_open(fridge) = true"),
        ("Close the fridge if it is open", "is_open(fridge) = false, if is_open(fridge) = true"),
        ("Should the lamp be on, switch it off", "is_on(lamp) = false, if is_on(lamp) = true"),
        ("Close the fridge if you find it", "is_open(fridge) = false, if located(fridge) = true"),
        ("Unless the lamp is on, switch it on", "is_on(lamp) = true, if is_on(lamp) = false"),
        ("Switch on the lamp at 5 pm", "is_on(lamp) = true, in 27000 s"),
        ("Switch on the lamp in ten minutes", "is_on(lamp) = true, in 600 s"),
        ("Close the fridge before noon", "is_open(fridge) = false, within 9000 s"),
        ("The fridge should be closed by 11", "is_open(fridge) = false, within 5400 s"),
        ("Close the fridge every evening", "is_open(fridge) = false, every 0 18 * * *"),
        ("On weekdays at 6:45, close the fridge", "is_open(fridge) = false, every 45 6 * * 1-5"),
        ("Hoover the hallway every two hours", "vacuumed(hallway) = true, every PT2H"),
        ("Bring the fork to the kitchen at once", "at(fork) = kitchen, with priority 1"),
        ("No rush, but close the fridge", "is_open(fridge) = false, with priority -1"),
        ("HSR, bring the fork to the kitchen", "at(fork) = kitchen, by hsr"),
        ("Have the locobot close the fridge", "is_open(fridge) = false, by locobot"),
    ],
)  # fmt: skip
def test_goals_say_more_than_what_is_reached(text: str, expected: str) -> None:
    assert told(read(text, SPOKEN, NOW)) == expected


def test_there_is_where_what_cannot_be_moved_stands() -> None:
    stands = replace(SPOKEN, carriers={**SPOKEN.carriers, "television": ("living_room",)})
    assert told(read("Switch on the television and bring the fork there", stands, NOW)) == (
        "is_on(television) = true and at(fork) = living_room"
    )
    with pytest.raises(NotUnderstood, match='"there" refers to no place'):
        read("Open the fridge and bring the fork there", stands, NOW)  # or into it?


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("The fork is in the bowl. Bring it to the hallway",
         "at(fork) = bowl is so; at(fork) = hallway"),
        ("I am in the kitchen. Bring the fork here",
         "at(anna) = kitchen is so; at(fork) = kitchen"),
        ("The lamp is not on", "is_on(lamp) = false is so"),
        ("Bring the fork to Anna, she is in the kitchen",
         "at(anna) = kitchen is so; at(fork) = anna"),
        ("Anna went to the hallway", "at(anna) = hallway is so"),
        ("Somebody left the fridge open", "is_open(fridge) = true is so"),
        ("Anna has washed the first cup", "clean(cup_1) = true is so"),
        ("We moved the lamp to the hallway", "at(lamp) = hallway is so"),
    ],
)  # fmt: skip
def test_facts_are_said_in_the_same_breath(text: str, expected: str) -> None:
    assert told(read(text, SPOKEN, NOW)) == expected


@pytest.mark.parametrize(
    ("text", "of", "subjects", "holds"),
    [
        ("Where is the fork?", "where", ["fork"], []),
        ("Which room is the fork in?", "where", ["fork"], []),
        ("How many cups are in the kitchen?", "how many", ["cup_1", "cup_2"], ["at(?) = kitchen"]),
        ("Which cups are dirty?", "which", ["cup_1", "cup_2"], ["clean(?) = false"]),
        ("What is in the fridge?", "which", [], ["in(?) = fridge"]),
        ("Is the fridge open?", "whether", [], ["is_open(fridge) = true"]),
        ("Who has the fork?", "who", [], ["at(fork) = ?"]),
        ("What are you doing?", "what doing", [], []),
        ("What is the hsr doing?", "what doing", ["hsr"], []),
        ("What can you do?", "what able", [], []),
        ("What are you able to do?", "what able", [], []),
        ("What can the hsr do?", "what able", ["hsr"], []),
    ],
)
def test_questions_are_data(text: str, of: str, subjects: list[str], holds: list[str]) -> None:
    reading = read(text, SPOKEN, NOW)
    assert not isinstance(reading, Ambiguity)
    assert reading.question is not None
    assert reading.question.of == of
    assert list(reading.question.subjects) == subjects
    assert list(map(str, reading.question.holds)) == holds
    assert not reading.goals


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Bring the cup to the hallway", "asks at(cup_1) = hallway | at(cup_2) = hallway"),
        ("Put the fork on the table", "asks on(fork) = coffee_table | on(fork) = kitchen_table"),
    ],
)
def test_what_can_be_several_things_is_asked(text: str, expected: str) -> None:
    reading = read(text, SPOKEN, NOW)
    assert told(reading) == expected
    assert isinstance(reading, Ambiguity)
    assert "could be" in reading.sentence


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("Bring the zorgle to the kitchen", "'the zorgle' is not a known object"),
        ("Zorgle the fork", "'Zorgle' is not understood as a goal"),
        ("Bring the fork to the kitchen with a zorgle", "'a zorgle' is not a known"),
        ("Turn off the lanp", "'the lanp' is not a known object (did you mean 'lamp'?)"),
        ("Turn off the lamb", "'the lamb' is not a known object; known are lamp, "),
        ("Turn left", "'Turn left' is not understood as a goal; known are turn off, turn on"),
        ("Anna the fork", "'Anna' is not understood as a goal"),
        ("Switch off the kitchen lamp", "'the kitchen lamp' is not a known object"),
        ("Anna two zorgles", "'Anna' is not understood as a goal"),
        ("Tell Anna a zorgle", "'Tell Anna' wants somebody to be told"),
        ("Open all the zorgles", "'all the zorgles' is not a known"),
        ("Ask Anna whether the fork is dirty", "'Ask Anna' wants somebody to be told or asked"),
        ("Bring the fork to the hallway and tell Anna it is there", "'tell Anna' wants somebody"),
        ("What if the fridge was open?", "'What if' only supposes something"),
        ("Close it. Then bring the zorgle blarg to me", "'the zorgle blarg' is not a known"),
        ("Close the fridge because the zorgle is warm", "'because' makes it depend on"),
        ("The fridge might zorgle", "'might' is uncertain"),
        ("Vacuum", "'Vacuum' ends where a place is missing; known are "),
        ("Put the fork under the coffee table", "'under' names a relation that is not known"),
        ("The fridge might be open", "'might' is uncertain"),
        ("Hang the fork up", "'hang' in 'Hang the fork up' does not say where to"),
        ("Close the fridge until noon", "'until' says how long, or until when"),
        ("Throw away the fork", "no bin is known to throw it into"),
        ("Vacuum Anna", "anna is no place"),
        ("Bring me a cup of zorgle", "'zorgle' is not a known object"),
        ("Bring a blarg of zorgle to Anna", "'zorgle' is not understood after"),
        ("I need a zorgle", "'a zorgle' is not a known object"),
        ("Actually, bring me the zorgle", "'the zorgle' is not a known object"),
        ("One more thing: zorgle the fork", "'zorgle' is not understood as a goal"),
        ("Starting with the hallway, vacuum every room", "'Starting with' says how"),
        ("Bring me the fork as gently as you can", "'gently' says how"),
        ("Close the fridge as zorglely as you can", "'zorglely as' is not understood after"),
        ("Anna left the kitchen", "'left' in 'Anna left the kitchen' is not understood as a fact"),
        ("The fork isn't in the fridge", '"isn\'t" in "The fork isn\'t in the fridge" says'),
        ("Put the fork in the bowl, she is in the kitchen", "'she' refers to nothing before it"),
        ("Turn the zorgles off", "'the zorgles' is not a known object"),
        ("Switch off the zorgle", "'the zorgle' is not a known object"),
        ("Cancel the last goal", "'Cancel' takes back what was asked for"),
        ("It is cold in here", "'cold' in 'It is cold in here' says how something is"),
        ("Will it be cold?", "'cold' in 'Will it be cold' is not understood as a question"),
    ],
)
def test_refusals_name_what_is_not_understood_first(text: str, says: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read(text, SPOKEN, NOW)
    assert str(refused.value).startswith(says) or says in str(refused.value)
    assert str(refused.value).count(", ") < 8


@pytest.mark.parametrize(
    "text",
    ["Keep the fridge closed", "If the fridge is open, close it", "HSR, bring the fork to the box",
     "Switch on the lamp at 5 pm", "The fork is in the bowl. Bring it to the hallway"],
)  # fmt: skip
def test_a_goal_that_is_reached_once_has_none_of_that(text: str) -> None:
    with pytest.raises(NotUnderstood):
        read_goal(text, FURNISHED)


@pytest.mark.parametrize(
    "text",
    ["x " * 100_000, "a" * 120_000, "bring the fork to the kitchen and " * 3_000, "fork " * 200],
)
def test_what_is_too_long_is_refused_at_once(text: str) -> None:
    with pytest.raises(NotUnderstood, match=r"at most|too many"):
        read(text, SPOKEN)


@pytest.mark.parametrize(
    ("verb", "done", "doing"),
    [("mop", "mopped", "mopping"), ("plug", "plugged", "plugging"), ("heat", "heated", "heating"),
     ("mow", "mowed", "mowing"), ("empty", "emptied", "emptying"), ("wash", "washed", "washing")],
)  # fmt: skip
def test_a_short_vowel_doubles_what_follows_it(verb: str, done: str, doing: str) -> None:
    assert participles(verb) == (done,)
    assert gerund(verb) == doing


@pytest.mark.parametrize(
    ("text", "by"),
    [
        (
            "The hsr shall bring the fork to the kitchen with the help of the locobot",
            "hsr and locobot",
        ),
        ("The hsr shall bring the fork to the kitchen with the locobot", "hsr and locobot"),
        ("The fork shall be brought to the kitchen by the hsr", "hsr"),
        ("The fork should be in the kitchen, brought there by the hsr", None),
    ],
)
def test_who_does_it_and_who_helps_are_named(text: str, by: str | None) -> None:
    if by is None:
        with pytest.raises(NotUnderstood):
            read(text, SPOKEN)
        return
    assert told(read(text, SPOKEN)).endswith(f", by {by}")
