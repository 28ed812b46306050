"""What is looked for and found, of whom nobody is meant, and conditions of which one is enough."""

from __future__ import annotations

import pytest

from benchmarks.language.reader import AskedBack, Read, Refused, answer

NOVEL = "goal located(novel) = true"
NOBODY = "not at(anna|ben|guest|lily)"
CLOSED = "is_on(radio) = false"


def meant(text: str) -> str:
    found = answer(text, "house")
    assert isinstance(found, Read), found
    return str(found.meaning)


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("Search the kitchen for the novel, and bring it to me if you find it",
         f"goal at(novel) = anna, when located(novel) = true & {NOVEL}; searched(kitchen) = true"),
        ("Search the kitchen for the novel, and if you find it bring it to me",
         f"goal at(novel) = anna, when located(novel) = true & {NOVEL}; searched(kitchen) = true"),
        ("Rosie, look for the novel and bring it to Ben if you find it",
         f"goal at(novel) = ben, when located(novel) = true, by rosie & {NOVEL}, by rosie"),
        ("If the stove is on, look for the novel and bring it if you find it",
         "goal at(novel) = anna, when is_on(stove) = true; located(novel) = true & "
         f"{NOVEL}, when is_on(stove) = true"),
        ("Every morning, look for the newspaper and bring it to me if you find it",
         "goal at(newspaper) = anna, when located(newspaper) = true, every 0 8 * * *"),
        ("Look for the novel, and bring me the cookbook if you can't find it",
         f"goal at(cookbook) = anna, when located(novel) = false & {NOVEL}"),
        ("If the novel has not been found, search the kitchen",
         "goal searched(kitchen) = true, when located(novel) = false"),
        ("If the novel can't be found, search the kitchen",
         "goal searched(kitchen) = true, when located(novel) = false"),
        ("If the novel has been found, bring it to Ben",
         "goal at(novel) = ben, when located(novel) = true"),
    ],
)  # fmt: skip
def test_what_is_looked_for_is_looked_for_whether_or_not_it_is_found(
    text: str, meaning: str
) -> None:
    assert meant(text) == meaning


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("If nobody is in the kitchen, turn off the stove",
         f"goal is_on(stove) = false, when {NOBODY} = kitchen"),
        ("Whenever there is no one in the living room, turn off the TV",
         f"goal is_on(tv) = false, whenever {NOBODY} = living_room"),
        ("When there is nobody in the kitchen, vacuum it",
         f"goal vacuumed(kitchen) = true, when {NOBODY} = kitchen"),
        ("If somebody is in the garage, open the garage door",
         "goal is_open(garage_door) = true, when at(anna|ben|guest|lily) = garage"),
        ("If no robot is in the kitchen, send Dusty there",
         "goal at(dusty) = kitchen, when not at(dusty|rosie) = kitchen"),
    ],
)  # fmt: skip
def test_nobody_and_somebody_are_all_of_whom_it_can_be_said(text: str, meaning: str) -> None:
    assert meant(text) == meaning


def test_nothing_is_none_of_all_that_can_be_moved() -> None:
    said = meant("If nothing is on the kitchen table, open the fridge")
    assert said.startswith("goal is_open(fridge) = true, when not on(alarm_clock|apple_1|")


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("If the fridge or the oven is open, turn off the radio",
         f"goal {CLOSED}, when is_open(fridge|oven) = true"),
        ("If the fridge is open or the TV is on, turn off the radio",
         f"goal {CLOSED}, when is_on(tv) = true; is_open(fridge) = false & "
         f"goal {CLOSED}, when is_open(fridge) = true"),
        ("Unless the fridge or the oven is open, turn off the radio",
         f"goal {CLOSED}, when is_open(fridge) = false; is_open(oven) = false"),
        ("Whenever the front door or the garage door is open, close it",
         "goal is_open(front_door) = false, whenever is_open(front_door) = true & "
         "goal is_open(garage_door) = false, whenever is_open(garage_door) = true"),
        ("If the milk is in the fridge and the cola is in the fridge, bring me the milk, "
         "otherwise bring me the juice",
         "goal at(juice) = anna, when in(milk) = fridge; not in(cola) = fridge & "
         "goal at(juice) = anna, when not in(milk) = fridge & "
         "goal at(milk) = anna, when in(cola) = fridge; in(milk) = fridge"),
        ("If the fridge or the oven is open, close it, otherwise turn off the radio",
         f"goal {CLOSED}, when is_open(fridge) = false; is_open(oven) = false & "
         "goal is_open(fridge) = false, when is_open(fridge) = true & "
         "goal is_open(oven) = false, when is_open(oven) = true"),
    ],
)  # fmt: skip
def test_one_of_several_conditions_is_enough(text: str, meaning: str) -> None:
    assert meant(text) == meaning


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("If the windows are open, close them",
         "goal is_open(bedroom_window) = false, when is_open(bedroom_window) = true & "
         "goal is_open(living_room_window) = false, when is_open(living_room_window) = true"),
        ("If the tomatoes are not in the fridge, put them there",
         "goal in(tomato_1) = fridge, when not in(tomato_1) = fridge & "
         "goal in(tomato_2) = fridge, when not in(tomato_2) = fridge"),
        ("If the tomatoes are not in the fridge, close it",
         "goal is_open(fridge) = false, when not in(tomato_1) = fridge; not in(tomato_2) = fridge"),
        ("If both windows are open, close them",
         "goal is_open(bedroom_window) = false; is_open(living_room_window) = false, when "
         "is_open(bedroom_window) = true; is_open(living_room_window) = true"),
    ],
)  # fmt: skip
def test_what_is_said_of_several_is_done_to_those_of_which_it_is_so(
    text: str, meaning: str
) -> None:
    assert meant(text) == meaning


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("If the fridge is open, close it and the oven",
         "goal is_open(fridge) = false; is_open(oven) = false, when is_open(fridge) = true"),
        ("If the fridge is open, close the oven and it",
         "goal is_open(fridge) = false; is_open(oven) = false, when is_open(fridge) = true"),
    ],
)  # fmt: skip
def test_it_is_one_of_several_that_something_is_done_to(text: str, meaning: str) -> None:
    assert meant(text) == meaning


@pytest.mark.parametrize("more", ["and the zorgle", "and zorgle off the radio", "or the oven"])
def test_what_stands_beside_it_is_not_lost(more: str) -> None:
    assert isinstance(answer(f"If the fridge is open, close it {more}", "house"), Refused)


@pytest.mark.parametrize(
    "text",
    [
        "When the fridge is open or the TV is on, turn off the radio",
        "If all the tomatoes are not in the fridge, put them there",
    ],
)
def test_conditions_that_do_not_say_what_is_enough_are_refused(text: str) -> None:
    assert isinstance(answer(text, "house"), Refused)


def test_which_of_two_is_to_be_found_is_asked() -> None:
    asked = answer("Look for the novel, and bring the cookbook if you find it", "house")
    assert isinstance(asked, AskedBack)
    assert "cookbook or novel" in asked.sentence


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("Bring me a cola and turn off the TV if it is on",
         "goal at(cola) = anna & goal is_on(tv) = false, when is_on(tv) = true"),
        ("Charge the laptop and bring it to Ben when it's charged",
         "goal at(laptop) = ben, when charged(laptop) = true & goal charged(laptop) = true"),
        ("Every evening, close the curtains and turn off the TV if it is on",
         "goal is_on(tv) = false, when is_on(tv) = true, every 0 18 * * * & "
         "goal is_open(curtains) = false, every 0 18 * * *"),
        ("If the stove is on, close the curtains and turn off the TV if it is on",
         "goal is_on(tv) = false, when is_on(stove) = true; is_on(tv) = true & "
         "goal is_open(curtains) = false, when is_on(stove) = true"),
        ("Wash the green mug and bring it to me if it is dirty",
         "goal at(green_mug) = anna; clean(green_mug) = true, when clean(green_mug) = false"),
        ("Close the curtains and turn on the floor lamp if the TV is on",
         "goal is_on(floor_lamp) = true; is_open(curtains) = false, when is_on(tv) = true"),
    ],
)  # fmt: skip
def test_a_condition_goes_for_what_it_is_about(text: str, meaning: str) -> None:
    assert meant(text) == meaning


def test_it_is_not_guessed_whether_what_comes_first_depends_on_a_condition() -> None:
    refused = answer("Water the fern, then turn off the TV if it is on", "house")
    assert isinstance(refused, Refused)
    assert "say it as two goals" in refused.sentence
