"""What "and", "or", "too" and "not" join shares what was said once, and drops nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fleet.errors import NotUnderstood
from fleet.language import read
from keyexpr_schema.payloads.world import Place
from tests.support.language_flat import thing
from tests.support.language_flat_said import SPOKEN, told

MORE = (
    *(thing(f"{colour}_bowl", properties={"colour": colour}) for colour in ("red", "green")),
    thing("red_block", properties={"colour": "red"}),
    thing("plate", "supports", home="kitchen"),
    thing("novel", uses=("read",)),
    thing("newspaper", uses=("read",)),
)
ROOMS = {f"room_{n}": Place(place=f"room_{n}", label=f"Room {n}") for n in (101, 102)}
FLAT = replace(
    SPOKEN,
    objects={**SPOKEN.objects, **{each.object: each for each in MORE}},
    places={**SPOKEN.places, **ROOMS},
)


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("Wash the red and the green bowl", "clean(red_bowl) = true and clean(green_bowl) = true"),
        ("Wash the red and green bowls", "clean(red_bowl) = true and clean(green_bowl) = true"),
        ("Wash the red, the green and the red bowl",
         "clean(red_bowl) = true and clean(green_bowl) = true"),
        ("Wash all bowls except the red and the green one", "clean(bowl) = true"),
        ("Bring the red, green and red bowls to the hallway",
         "at(red_bowl) = hallway and at(green_bowl) = hallway"),
        ("Bring me a red or green bowl", "at(red_bowl or green_bowl) = anna"),
        ("Wash the clean and the dirty cup", "clean(cup_2) = true and clean(cup_1) = true"),
        ("Vacuum rooms 101 and 102", "vacuumed(room_101) = true and vacuumed(room_102) = true"),
        ("Put the fork on the coffee table and the plate in the fridge",
         "on(fork) = coffee_table and in(plate) = fridge"),
        ("Put the fork on the coffee table, and the plate as well",
         "on(fork) = coffee_table and on(plate) = coffee_table"),
        ("Bring the first cup to the kitchen and the second one too",
         "at(cup_1) = kitchen and at(cup_2) = kitchen"),
        ("Wash the first cup. The same with the second one.",
         "clean(cup_1) = true and clean(cup_2) = true"),
        ("Put the fork in the fridge and do the same with the plate",
         "in(fork) = fridge and in(plate) = fridge"),
        ("Put the fork in the fridge. Then likewise the plate.",
         "in(fork) = fridge, then in(plate) = fridge"),
        ("The fridge should be closed. The cupboard, too.",
         "is_open(fridge) = false and is_open(cupboard) = false"),
        ("Look for the fork in the kitchen and in the hallway",
         "searched(kitchen) = true and searched(hallway) = true and located(fork) = true"),
        ("Search in the kitchen and in the hallway",
         "searched(kitchen) = true and searched(hallway) = true"),
        ("Wash the cups in the fridge and on the kitchen table",
         "clean(cup_2) = true and clean(cup_1) = true"),
        ("Bring the cups from the fridge and the kitchen table to the hallway",
         "at(cup_2) = hallway and at(cup_1) = hallway"),
        ("The cups in the fridge and on the kitchen table should be clean",
         "clean(cup_2) = true and clean(cup_1) = true"),
        ("Bring me something to read, not the newspaper", "at(novel) = anna"),
        ("Bring me a cup, not the fork", "at(cup_1 or cup_2) = anna"),
    ],
)  # fmt: skip
def test_what_is_joined_shares_what_is_said_once(text: str, meant: str) -> None:
    assert told(read(text, FLAT)) == meant


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("The same with the fork", "'The same with the fork' is said of nothing before it"),
        ("Put the fork in the fridge and the plate on the coffee table. The novel, too.",
         "'The novel' is said of nothing before it"),
        ("Every morning, wash the first cup. The second one too.", "is said of nothing before it"),
        ("In ten minutes, wash the first cup. Likewise the second one.",
         "is said of nothing before it"),
        ("Bring the fork and the novel or the newspaper to the kitchen",
         "it does not say where to bring fork"),
        ("Put the cups in the fridge and on the kitchen table", "wants cup_1 in two places"),
        ("Bring the novel or the newspaper and the fork to the hallway", "does not say where to"),
        ("Wash the red bowl and the first cup or the second cup", "leaves open what goes together"),
        ("Bring me two bowls, a red one and a green one", "'a red one' were named before"),
        ("Bring me the biggest of the cups and bowls", "the biggest"),
        ("Wash the cups and the bowls, the red ones", "'the red ones' were named before"),
    ],
)  # fmt: skip
def test_what_leaves_open_what_goes_together_is_refused(text: str, says: str) -> None:
    with pytest.raises(NotUnderstood, match=says):
        read(text, FLAT)
