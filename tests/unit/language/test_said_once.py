"""What several verbs, receivers or things have in common is said once."""

from __future__ import annotations

import pytest

from benchmarks.language.reader import AskedBack, Read, Refused, answer

ANY_APPLE = "apple_1|apple_2|apple_3"


def meant(text: str, world: str = "house") -> str:
    found = answer(text, world)
    assert isinstance(found, Read), found
    return str(found.meaning)


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("Wash, fold and put away the blue shirt",
         "goal clean(blue_shirt) = true; folded(blue_shirt) = true; in(blue_shirt) = wardrobe"),
        ("Rosie, wash and fold the blue shirt",
         "goal clean(blue_shirt) = true; folded(blue_shirt) = true, by rosie"),
        ("Tell Dusty to vacuum and mop the kitchen",
         "goal mopped(kitchen) = true; vacuumed(kitchen) = true, by dusty"),
        ("Wash and bring me the red mug", "goal at(red_mug) = anna; clean(red_mug) = true"),
        ("Open and close the fridge", "goal is_open(fridge) = true > is_open(fridge) = false"),
        ("Vacuum the kitchen and mop it", "goal mopped(kitchen) = true; vacuumed(kitchen) = true"),
        ("Mop the kitchen after vacuuming it",
         "goal vacuumed(kitchen) = true > mopped(kitchen) = true"),
        ("Give Ben and Lily an apple each",
         f"goal at({ANY_APPLE}) = ben; at({ANY_APPLE}) = lily"),
        ("Put one plate on the dining table and the other two in the dishwasher",
         "goal in(plate_1|plate_2) = dishwasher; in(plate_1|plate_3) = dishwasher; "
         "in(plate_2|plate_3) = dishwasher; on(plate_1|plate_2|plate_3) = dining_table"),
        ("Put the apples in the big bowl and bring it to Ben",
         "goal at(big_bowl) = ben; in(apple_1) = big_bowl; in(apple_2) = big_bowl; "
         "in(apple_3) = big_bowl"),
        ("Put the cola on the tray and bring both to the living room",
         "goal at(tray) = living_room; on(cola) = tray"),
        ("Take the soup to Ben with a spoon", "goal at(soup) = ben; at(spoon_1) = ben"),
        ("Put the big bowl with a spoon in it on the kitchen table",
         "goal in(spoon_1) = big_bowl; on(big_bowl) = kitchen_table"),
        ("Turn off the TV and everything else in the living room",
         "goal is_on(floor_lamp) = false; is_on(laptop) = false; is_on(radio) = false; "
         "is_on(tv) = false"),
        ("Bring me the cola, but close the fridge afterwards",
         "goal at(cola) = anna > is_open(fridge) = false"),
        ("Two things: water the fern and wash the pan",
         "goal clean(pan) = true; watered(fern) = true"),
        ("The novel belongs on the bookshelf, and so does the cookbook",
         "goal on(cookbook) = bookshelf; on(novel) = bookshelf"),
        ("Put all the clean mugs in the cupboard and the dirty ones in the dishwasher",
         "goal in(blue_mug) = cupboard; in(green_mug) = dishwasher; in(red_mug) = dishwasher"),
        ("Could you get me the novel and put it on the sofa?", "goal on(novel) = sofa"),
        ("Find out where the novel is and bring it to me", "goal at(novel) = anna"),
        ("1. Wash the pan. 2. Put it in the cupboard.",
         "goal clean(pan) = true > in(pan) = cupboard"),
        ("Bring only the red apples to Lily", "goal at(apple_1) = lily; at(apple_3) = lily"),
        ("Visit the kitchen", "goal at(dusty|rosie) = kitchen"),
        ("Keep the fridge closed, the TV off and the curtains closed",
         "goal always is_on(tv) = false; is_open(curtains) = false; is_open(fridge) = false"),
        ("Keep the novel in the kitchen and the cookbook in the bedroom",
         "goal always at(cookbook) = bedroom; at(novel) = kitchen"),
        ("Turn on the heater now and turn it off in an hour",
         "goal is_on(heater) = false, not_before_s 3600.0 & goal is_on(heater) = true"),
        ("Take the teddy from the sofa and the doll from the toy box to Lily",
         "goal at(doll) = lily; at(teddy) = lily"),
        ("Check that the oven is off, and if it isn't, turn it off",
         "goal is_on(oven) = false, when is_on(oven) = true"),
        ("Turn off the radio and turn on the TV instead",
         "goal is_on(radio) = false; is_on(tv) = true"),
    ],
)  # fmt: skip
def test_what_is_said_once_goes_for_each(text: str, meaning: str) -> None:
    assert meant(text) == meaning


@pytest.mark.parametrize(
    ("text", "world", "meaning"),
    [
        ("Bring each patient a blanket", "hospital",
         "goal at(blanket_1|blanket_2) = mr_jones; at(blanket_1|blanket_2) = mrs_lee"),
        ("Open the blinds and the window in the open office", "office",
         "goal is_open(blinds) = true; is_open(office_window) = true"),
        ("Place the small box on the large box and move both to shipping", "warehouse",
         "goal at(large_box) = shipping; in(small_box) = large_box"),
    ],
)  # fmt: skip
def test_what_is_said_once_goes_for_each_elsewhere(text: str, world: str, meaning: str) -> None:
    assert meant(text, world) == meaning


@pytest.mark.parametrize(
    "text",
    [
        "put away",
        "Have the plates washed and put away",
        "Give Ben and Lily the doll",
        "Windows closed?",
        "Turn on the heater and turn it off in an hour",
        "The fridge should never be open and the lights off",
        "Only Rosie should go to the kitchen",
    ],
)
def test_what_does_not_say_of_what_is_refused(text: str) -> None:
    assert isinstance(answer(text, "house"), Refused)


def test_a_robot_is_not_brought_along_with_things() -> None:
    text = "Rosie, bring Ben the novel, and Dusty, go to the garage"
    found = answer(text, "house")
    assert isinstance(found, Refused)
    assert "robots and things" in found.sentence


def test_which_vessel_is_meant_is_asked() -> None:
    assert isinstance(answer("Place a bowl with a spoon in it on the counter", "house"), AskedBack)
