"""How many, which of them, of each, and what is left out: nothing is taken for more or for less."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.language.reader import Read, Refused, answer, vocabulary_of
from fleet.language import Ambiguity, read

EACH_PLATE = "; ".join(f"on(apple_1|apple_2|apple_3) = plate_{n}" for n in (1, 2, 3))
LIGHTS = ("bedside_lamp", "dining_room_light", "floor_lamp", "hall_light")


def meant(text: str) -> str:
    found = answer(text, "house")
    assert isinstance(found, Read), found
    return str(found.meaning)


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("Take the apples and put one on each plate", f"goal {EACH_PLATE}"),
        ("Bring me a green or red apple", "goal at(apple_1|apple_2|apple_3) = anna"),
        ("Bring me a mug or glass", "goal at(blue_mug|glass_1|glass_2|green_mug|red_mug) = anna"),
        ("Get me a knife and fork",
         "goal at(bread_knife|butter_knife) = anna; at(fork_1) = anna"),
        ("Bring the red and green apples to Lily",
         "goal at(apple_1) = lily; at(apple_2) = lily; at(apple_3) = lily"),
        ("turn on the radio, but not the TV", "goal is_on(radio) = true"),
        ("Vacuum the hallway, but not the bedroom", "goal vacuumed(hallway) = true"),
        ("Turn off the lights, but not the bathroom light",
         "goal " + "; ".join(f"is_on({name}) = false" for name in LIGHTS)),
        ("Bring me apple 1 and not apple 2", "goal at(apple_1) = anna"),
        ("Collect all the dirty glasses and wash them", "goal clean(glass_2) = true"),
        ("Get my phone and plug it in", "goal charged(phone) = true"),
        ("I have the phone", "facts at(phone) = anna"),
        ("Where am I?", "question where of anna"),
        ("Nobody knows whether the fridge is open", "facts is_open(fridge) = None"),
        ("Don't let anybody into the bedroom",
         "goal never at(dusty) = bedroom; at(rosie) = bedroom"),
        ("Put plate 1 on the kitchen table, and the one in the sink too",
         "goal on(plate_1) = kitchen_table; on(plate_3) = kitchen_table"),
        ("Is there any milk left?", "question whether of milk"),
        ("Turn off the TV tonight at 9", "goal is_on(tv) = false, not_before_s 41400.0"),
        ("At 9 pm tonight, turn off the TV", "goal is_on(tv) = false, not_before_s 41400.0"),
        ("Can Rosie fold shirts?",
         "question what able of rosie: folded(blue_shirt) = true; folded(white_shirt) = true"),
        ("Can Rosie fold the blue shirt?", "goal folded(blue_shirt) = true, by rosie"),
    ],
)  # fmt: skip
def test_no_more_and_no_less_is_meant(text: str, meaning: str) -> None:
    assert meant(text) == meaning


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("Bring me too apples", "'too'"),
        ("turn on the radio, but not the zorgle", "zorgle"),
        ("leave the kitchen", "where not to be"),
        ("Put the purple book on the bookshelf", "'purple' in 'the purple book'"),
        ("Go to the kitchen and wait there", "'wait' says to stay"),
        ("Nobody knows whether the novel is in the kitchen", "what can be unknown is a state"),
    ],
)
def test_what_would_be_lost_is_named(text: str, names: str) -> None:
    refused = answer(text, "house")
    assert isinstance(refused, Refused)
    assert names in refused.sentence


def test_what_a_person_holds_is_left_with_them() -> None:
    house = vocabulary_of("house")
    held = replace(house, carriers={**house.carriers, "novel": ("anna", "living_room")})
    found = read("Tidy up the living room", held)
    assert not isinstance(found, Ambiguity)
    wanted = {row.subject for row in found.stages[0]}
    assert "novel" not in wanted
    assert "magazine" in wanted
    assert found.left_out == ("novel is left with anna, who has it",)


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("Take Mr Jones's chart to Dr Smith and Mrs Lee's to nurse Sam",
         "goal at(jones_file) = dr_smith; at(lee_file) = sam"),
        ("Collect the dirty linen and take it to the laundry",
         "goal at(blanket_2) = laundry; at(sheet_1) = laundry"),
        ("Get a clean blanket for Mrs Lee and take the dirty one to the laundry",
         "goal at(blanket_1) = mrs_lee; at(blanket_2) = laundry"),
    ],
)  # fmt: skip
def test_whose_and_of_what_kind_is_said_once(text: str, meaning: str) -> None:
    found = answer(text, "hospital")
    assert isinstance(found, Read), found
    assert str(found.meaning) == meaning
