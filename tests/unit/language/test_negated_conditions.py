"""What must not hold ("if … not", "unless", "if there is no …"), and what is wanted otherwise."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest

from fleet.errors import NotUnderstood
from fleet.language import read
from tests.support.language_flat_said import SPOKEN, told

NOW = datetime(2026, 3, 4, 9, 30, tzinfo=UTC)
CLOSED, OPENED = "is_open(fridge) = false", "is_open(fridge) = true"
BOTH = f"{CLOSED}, if {OPENED}; otherwise {OPENED}, if {CLOSED}"


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("If the fork is not in the kitchen, bring it there",
         "at(fork) = kitchen, if at(fork) != kitchen"),
        ("When the fork is no longer in the kitchen, close the fridge",
         f"{CLOSED}, when at(fork) != kitchen"),
        ("Whenever the fork isn't in the kitchen, bring it to the kitchen",
         "at(fork) = kitchen, each time that at(fork) != kitchen"),
        ("Bring the fork to the kitchen unless it is in the hallway",
         "at(fork) = kitchen, if at(fork) != hallway"),
        ("Unless the fork is not in the kitchen, close the fridge",
         f"{CLOSED}, if at(fork) = kitchen"),
        ("If the fridge is not closed, close it", f"{CLOSED}, if {OPENED}"),
        ("If there is a cup in the kitchen, close the fridge",
         f"{CLOSED}, if at(cup_1 or cup_2) = kitchen"),
        ("If there is no cup in the kitchen, close the fridge",
         f"{CLOSED}, if at(cup_1 or cup_2) != kitchen"),
        ("If there isn't a fork in the kitchen, close the fridge",
         f"{CLOSED}, if at(fork) != kitchen"),
        ("Close the fridge if there are no cups in the kitchen",
         f"{CLOSED}, if at(cup_1 or cup_2) != kitchen"),
        ("If the fork is missing, look for it", "located(fork) = true, if located(fork) = false"),
        ("Look for the fork; if you do not find it close the fridge",
         f"located(fork) = true; {CLOSED}, if located(fork) = false"),
        ("Look for the fork, and if you can't find it, close the fridge",
         f"located(fork) = true; {CLOSED}, if located(fork) = false"),
        ("The fridge is open. If the fridge is open, close it.",
         f"{OPENED} is so; {CLOSED}, if {OPENED}"),
        ("The fridge should be closed when the lamp is on", f"{CLOSED}, when is_on(lamp) = true"),
        ("If the fridge is open, close it. Otherwise open it.", BOTH),
        ("If the fridge is open, close it, otherwise open it.", BOTH),
        ("If the fridge is open, close it, or else open it.", BOTH),
        ("Close the fridge if it is open; if not, open it.", BOTH),
        ("Every morning, if the fridge is open, close it; otherwise open it.",
         f"{CLOSED}, if {OPENED}, every 0 8 * * *; "
         f"otherwise {OPENED}, if {CLOSED}, every 0 8 * * *"),
        ("Look for the fork. If you find it, bring it to the kitchen. If not, close the fridge.",
         "located(fork) = true; at(fork) = kitchen, if located(fork) = true; "
         f"otherwise {CLOSED}, if located(fork) = false"),
    ],
)  # fmt: skip
def test_what_must_not_hold_is_a_condition(text: str, meant: str) -> None:
    assert told(read(text, SPOKEN, NOW)) == meant


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("Unless the fridge and the cupboard are open, close the fridge", "which of them does not"),
        ("If all cups are not in the kitchen, close the fridge", "what is not so"),
        ("If the fork is not in the kitchen and the lamp is on, close the fridge", "not so"),
        ("Close the fridge. Otherwise open it.", "'otherwise' belongs to no condition"),
        ("When the lamp is on, close the fridge. Otherwise open it.", "to no condition"),
        ("If the fridge and cupboard are open or the lamp is on, open the fridge", "one thing or"),
        ("If the fridge is open, close it; otherwise open it at 5 pm.", "'at 5 pm' is a time"),
        ("The fork is not in the kitchen", "what is not so"),
        ("Search the kitchen. If you don't find the fork, close the fridge.", "look for"),
    ],
)  # fmt: skip
def test_what_is_not_said_plainly_is_refused(text: str, says: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read(text, SPOKEN, NOW)
    assert says in str(refused.value)
