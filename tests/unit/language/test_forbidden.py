"""What must not be done is what must never be so, or is refused by name."""

from __future__ import annotations

import pytest

from fleet.errors import NotUnderstood
from fleet.language import read
from tests.support.language_flat_said import SPOKEN, told

CUPS = "never on(cup_1) = coffee_table, never on(cup_2) = coffee_table"


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("Don't put the fork on the coffee table", "never on(fork) = coffee_table"),
        ("Do not put cups on the coffee table", CUPS),
        ("Never put a cup on the coffee table", CUPS),
        ("No cups may be on the coffee table", CUPS),
        ("There should be no cups on the coffee table", CUPS),
        ("Don't let the cups on the coffee table", CUPS),
        ("Don't put the fork in the fridge or the bowl",
         "never in(fork) = fridge, never in(fork) = bowl"),
        ("Don't give Anna the fork", "never at(fork) = anna"),
        ("Don't open the fridge or the cupboard",
         "never is_open(fridge) = true, never is_open(cupboard) = true"),
        ("No cupboard should be open", "never is_open(cupboard) = true"),
        ("Don't move the lamp", "never held(lamp) = true"),
        ("Don't take the first cup off the kitchen table", "never held(cup_1) = true"),
        ("Don't pick up the fork", "never held(fork) = true"),
        ("Don't let the locobot into the kitchen", "never at(locobot) = kitchen"),
        ("Don't drive to the kitchen or the hallway",
         "never at(hsr) = kitchen, never at(locobot) = kitchen, never at(hsr) = hallway, "
         "never at(locobot) = hallway"),
        ("Bring the fork to the kitchen and don't put it on the kitchen table",
         "at(fork) = kitchen, never on(fork) = kitchen_table"),
        ("Bring the fork to the kitchen, but don't open the fridge",
         "at(fork) = kitchen, never is_open(fridge) = true"),
    ],
)  # fmt: skip
def test_it_must_never_be_so(text: str, meant: str) -> None:
    assert told(read(text, SPOKEN)) == meant


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("The hsr should never put cups on the coffee table", "to all robots only"),
        ("Bring the fork to the kitchen, but don't bring the fork to the kitchen",
         r"it wants at\(fork\) = kitchen, and that this never be so"),
        ("Don't take the fork out of the kitchen", "'take' is nothing that can be forbidden"),
        ("Don't put two cups on the coffee table", "'two cups': it is forbidden of none or of all"),
        ("Don't wash two cups", "'two cups': it is forbidden of none or of all"),
        ("Don't drop the fork", "'drop' is nothing that can be forbidden here"),
        ("Don't leave the fork on the coffee table", "'leave' is nothing that can be forbidden"),
        ("Don't move", "does not say which place: name it; `robotctl stop --all` brings all robots "
         "to rest at once, and `robotctl pause` holds"),
        ("The hsr must not go anywhere", "`robotctl stop --all` brings all robots to rest at once"),
        ("Don't enter", "does not say which place: name it$"),
        ("Don't put the fork away", "'put away' is nothing that can be forbidden"),
    ],
)  # fmt: skip
def test_what_says_no_state_is_refused_by_name(text: str, says: str) -> None:
    with pytest.raises(NotUnderstood, match=says):
        read(text, SPOKEN)
