"""Goals that are understood, and what they mean."""

from __future__ import annotations

import pytest

from fleet.language import read_goal
from tests.support.language_house import WORDS, shown


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Bring the first cup to the hallway", "at(cup_1) = hallway"),
        ("Please take cup 2 into the living room.", "at(cup_2) = living_room"),
        ("deliver the second cup to the lounge!", "at(cup_2) = living_room"),
        ("put the book in the cooking area", "at(book) = kitchen"),
        (
            "Put the first cup on the locobot and send it to the hallway",
            "at(cup_1) = locobot; at(locobot) = hallway",
        ),
        ("second cup to the kitchen", "at(cup_2) = kitchen"),
        (
            "Bring everything except the book to the kitchen",
            "at(cup_1) = kitchen; at(cup_2) = kitchen",
        ),
        ("Move the red book to living_room", "at(book) = living_room"),
        ("Bring both cups to the hallway", "at(cup_1) = hallway; at(cup_2) = hallway"),
        (
            "Bring the first cup to the hallway and the second cup to the living room",
            "at(cup_1) = hallway; at(cup_2) = living_room",
        ),
        ("Send the locobot to the kitchen", "at(locobot) = kitchen"),
        ("hsr, go to the hallway", "at(hsr) = hallway"),
        ("Go to the kitchen", "at(hsr|locobot) = kitchen"),
        ("Find a cup somewhere and bring it to the hallway", "at(cup_1|cup_2) = hallway"),
        (
            "Bring the first cup to the hallway and then to the kitchen",
            "at(cup_1) = hallway > at(cup_1) = kitchen",
        ),
        (
            "Find a cup, then bring it to the hallway",
            "located(cup_1|cup_2) > at(cup_1|cup_2) = hallway",
        ),
        ("fetch the first cup from the kitchen and bring it to the hallway", "at(cup_1) = hallway"),
        ("Bring the first cup from the kitchen to the hallway", "at(cup_1) = hallway"),
        ("Where is the book?", "located(book)"),
        ("Search every room", "searched(hallway); searched(kitchen); searched(living_room)"),
        ("look around in the kitchen", "searched(kitchen)"),
        ("Go to the kitchen and look around", "searched(kitchen)"),
        ("pick up the red cup", "held(cup_1)"),
        ("Pick up the first cup and put it in the hallway", "at(cup_1) = hallway"),
        ("Hand the first cup over to the locobot", "at(cup_1) = locobot"),
        ("give the locobot the book", "at(book) = locobot"),
        ("Put cups 1 and 2 in the locobot's basket", "at(cup_1) = locobot; at(cup_2) = locobot"),
        ("put the red cup in the basket", "at(cup_1) = locobot"),
        ("tidy up", "at(cup_1) = kitchen; at(cup_2) = kitchen; at(book) = living_room"),
        ("Put the book back", "at(book) = living_room"),
        ("Make sure that the red cup is in the hallway", "at(cup_1) = hallway"),
        ("I need the first cup in the hallway", "at(cup_1) = hallway"),
        ("I want you to bring a cup to the kitchen please", "at(cup_1|cup_2) = kitchen"),
        (
            "Bring all cups and the book to the hallway",
            "at(cup_1) = hallway; at(cup_2) = hallway; at(book) = hallway",
        ),
        (
            "Bring everything to the kitchen",
            "at(cup_1) = kitchen; at(cup_2) = kitchen; at(book) = kitchen",
        ),
        ("Bring two cups to the hallway", "at(cup_1) = hallway; at(cup_2) = hallway"),
        ("Bring one of the cups to the hallway", "at(cup_1|cup_2) = hallway"),
        ("Put the book on the kitchen table", "at(book) = kitchen"),
        ("Put the book on the table in the hallway", "at(book) = hallway"),
        ("Put the book in the hallway on the table", "at(book) = hallway"),
        (
            "Bring the first cup to the hallway and the other one to the kitchen",
            "at(cup_1) = hallway; at(cup_2) = kitchen",
        ),
        (
            "bring a cup to the kitchen and a cup to the hallway",
            "at(cup_1|cup_2) = kitchen; at(cup_1|cup_2) = hallway",
        ),
        (
            "go to the kitchen and get the first cup to the hallway",
            "at(hsr|locobot) = kitchen > at(cup_1) = hallway",
        ),
        ("Robot, bring the book to the kitchen", "at(book) = kitchen"),
        ("a robot should go to the kitchen", "at(hsr|locobot) = kitchen"),
        ("send all robots to the hallway", "at(hsr) = hallway; at(locobot) = hallway"),
        ("Find everything", "located(cup_1); located(cup_2); located(book); located(fridge)"),
        ("find the fridge", "located(fridge)"),
        ("Take the book then put it in the kitchen", "held(book) > at(book) = kitchen"),
        ("Could you bring the book to the kitchen?", "at(book) = kitchen"),
        ("Would you mind bringing the book to the kitchen?", "at(book) = kitchen"),
        (
            "First put the book in the kitchen, then send the hsr to the hallway. Finally, tidy up",
            "at(book) = kitchen > at(hsr) = hallway > "
            "at(cup_1) = kitchen; at(cup_2) = kitchen; at(book) = living_room",
        ),
        (
            "first, go to the kitchen; then pick up the first cup",
            "at(hsr|locobot) = kitchen > held(cup_1)",
        ),
        ("Bring the 2nd cup to the kitchen, thanks", "at(cup_2) = kitchen"),
        ("Take the cups to the lounge", "at(cup_1) = living_room; at(cup_2) = living_room"),
        ("Take the last cup to the lounge", "at(cup_2) = living_room"),
        ("bring every cup to the lounge", "at(cup_1) = living_room; at(cup_2) = living_room"),
        ("bring some cup to the lounge", "at(cup_1|cup_2) = living_room"),
        ("bring cup number two to the lounge", "at(cup_2) = living_room"),
        ("bring cup #2 to the lounge", "at(cup_2) = living_room"),
        ("bring the blue mug to the lounge", "at(cup_2) = living_room"),
        ("bring the blue cup to the lounge", "at(cup_2) = living_room"),
        ("bring the mug to the lounge", "at(cup_2) = living_room"),
        ("search the kitchen for the book", "searched(kitchen); located(book)"),
        ("look for the book in the kitchen", "searched(kitchen); located(book)"),
        (
            "Send a robot to the kitchen and a robot to the hallway",
            "at(hsr|locobot) = kitchen; at(hsr|locobot) = hallway",
        ),
        (
            "Drive the HSR and the locobot to the lounge",
            "at(hsr) = living_room; at(locobot) = living_room",
        ),
        ("move to the kitchen", "at(hsr|locobot) = kitchen"),
        ("return to the kitchen", "at(hsr|locobot) = kitchen"),
        ("return the book", "at(book) = living_room"),
        ("bring the book home", "at(book) = living_room"),
        (
            "take the first cup off the kitchen table and bring it to the coffee table",
            "at(cup_1) = living_room",
        ),
        (
            "bring both cups from the kitchen to the hallway",
            "at(cup_1) = hallway; at(cup_2) = hallway",
        ),
        ("the book must be brought to the hallway", "at(book) = hallway"),
        ("make sure the kitchen is searched", "searched(kitchen)"),
        ("The kitchen should be searched", "searched(kitchen)"),
        (
            "The first cup should be in the hallway and the second cup in the kitchen",
            "at(cup_1) = hallway; at(cup_2) = kitchen",
        ),
        ("there should be a cup in the hallway", "at(cup_1|cup_2) = hallway"),
        ("there should be two cups in the hallway", "at(cup_1) = hallway; at(cup_2) = hallway"),
        ("Tell the HSR to go to the kitchen", "at(hsr) = kitchen"),
        ("Let the hsr drive to the kitchen", "at(hsr) = kitchen"),
        ("Can the hsr go to the kitchen?", "at(hsr) = kitchen"),
        (
            "bring the first cup, the second cup, and the book to the hallway",
            "at(cup_1) = hallway; at(cup_2) = hallway; at(book) = hallway",
        ),
        ("Bring cup 1 or cup 2 to the hallway", "at(cup_1|cup_2) = hallway"),
        ("Search the house", "searched(kitchen); searched(living_room); searched(hallway)"),
        (
            "search everywhere for the book",
            "searched(kitchen); searched(living_room); searched(hallway); located(book)",
        ),
        ("patrol all rooms", "searched(hallway); searched(kitchen); searched(living_room)"),
        ("bring the book into the living-room", "at(book) = living_room"),
        ("BRING THE BOOK TO THE KITCHEN!!!", "at(book) = kitchen"),
        ("tidy up the house", "at(cup_1) = kitchen; at(cup_2) = kitchen; at(book) = living_room"),
        ("tidy up the cups", "at(cup_1) = kitchen; at(cup_2) = kitchen"),
        ("clean up everything", "at(cup_1) = kitchen; at(cup_2) = kitchen; at(book) = living_room"),
        ("put everything away", "at(cup_1) = kitchen; at(cup_2) = kitchen; at(book) = living_room"),
        (
            "put everything back where it belongs",
            "at(cup_1) = kitchen; at(cup_2) = kitchen; at(book) = living_room",
        ),
        ("pick both cups up", "held(cup_1); held(cup_2)"),
        (
            "Go to the kitchen, pick up the first cup and bring it to the hallway",
            "at(hsr|locobot) = kitchen > at(cup_1) = hallway",
        ),
        ("I'd like the book in the kitchen.", "at(book) = kitchen"),
        ("I want the book to be brought to the kitchen", "at(book) = kitchen"),
        ("I want the book brought to the kitchen", "at(book) = kitchen"),
        ("Bring book and first cup to hallway", "at(book) = hallway; at(cup_1) = hallway"),
        ("robot: bring book to hall", "at(book) = hallway"),
        ("find the cups and bring them to the hallway", "at(cup_1) = hallway; at(cup_2) = hallway"),
        (
            "Find both cups, then bring the first one to the hallway, the second one to the lounge",
            "located(cup_1); located(cup_2) > at(cup_1) = hallway; at(cup_2) = living_room",
        ),
        ("where are the cups?", "located(cup_1); located(cup_2)"),
        ("do you know where the book is?", "located(book)"),
        (
            "Please look around everywhere",
            "searched(kitchen); searched(living_room); searched(hallway)",
        ),
        ("check the living room and the kitchen", "searched(living_room); searched(kitchen)"),
        (
            "put book in kitchen, cup 1 in hallway, cup 2 in lounge",
            "at(book) = kitchen; at(cup_1) = hallway; at(cup_2) = living_room",
        ),
        ("get a robot to the kitchen", "at(hsr|locobot) = kitchen"),
        ("Have a look in the kitchen", "searched(kitchen)"),
        ("the locobot should be at the kitchen", "at(locobot) = kitchen"),
        ("Take two of the cups to the kitchen", "at(cup_1) = kitchen; at(cup_2) = kitchen"),
        ("bring 1 cup to the kitchen", "at(cup_1|cup_2) = kitchen"),
        ("bring the two cups to the kitchen", "at(cup_1) = kitchen; at(cup_2) = kitchen"),
        ("bring the books to the kitchen", "at(book) = kitchen"),
        (
            "Take the book to the kitchen then go to the hallway",
            "at(book) = kitchen > at(hsr|locobot) = hallway",
        ),
        ("return the book to the hallway", "at(book) = hallway"),
        ("return to the hallway", "at(hsr|locobot) = hallway"),
        ("Pick up the book, go to the hallway and put it down there", "at(book) = hallway"),
        ("Everybody go to the kitchen", "at(hsr) = kitchen; at(locobot) = kitchen"),
        ("Someone should take the book to the kitchen", "at(book) = kitchen"),
        ("Bring the book to the kitchen as soon as possible", "at(book) = kitchen"),
        ("I'd love to have the book in the kitchen", "at(book) = kitchen"),
        ("put down the book in the kitchen", "at(book) = kitchen"),
        ("gather all cups in the kitchen", "at(cup_1) = kitchen; at(cup_2) = kitchen"),
        ("bring the blue and red cups to the hallway", "at(cup_2) = hallway; at(cup_1) = hallway"),
        (
            "bring all cups and books to the hallway",
            "at(cup_1) = hallway; at(cup_2) = hallway; at(book) = hallway",
        ),
        (
            "bring the first and second cup to the hallway",
            "at(cup_1) = hallway; at(cup_2) = hallway",
        ),
        ("bring the first and the last cup home", "at(cup_1) = kitchen; at(cup_2) = kitchen"),
        (
            "bring a cup to the hallway and another one to the lounge",
            "at(cup_1|cup_2) = hallway; at(cup_1|cup_2) = living_room",
        ),
        (
            "bring a cup to the hallway and the other one to the lounge",
            "at(cup_1|cup_2) = hallway; at(cup_1|cup_2) = living_room",
        ),
        (
            "bring the first cup to the hallway and another cup to the hallway",
            "at(cup_1) = hallway; at(cup_2) = hallway",
        ),
        (
            "bring the first cup to the hallway and a cup to the lounge",
            "at(cup_1) = hallway; at(cup_2) = living_room",
        ),
        (
            "look for a cup in the kitchen and the hallway",
            "searched(kitchen); searched(hallway); located(cup_1|cup_2)",
        ),
        (
            "look for the book everywhere",
            "searched(kitchen); searched(living_room); searched(hallway); located(book)",
        ),
        (
            "look for the book in every room",
            "searched(hallway); searched(kitchen); searched(living_room); located(book)",
        ),
        (
            "Go to the kitchen, pick up the first cup, go to the hallway and put it down there",
            "at(hsr|locobot) = kitchen > at(cup_1) = hallway",
        ),
        (
            "Bring the first cup to the kitchen and the second to the hallway",
            "at(cup_1) = kitchen; at(cup_2) = hallway",
        ),
        (
            "find both cups and bring both to the hallway",
            "at(cup_1) = hallway; at(cup_2) = hallway",
        ),
        (
            "find both cups and bring all of them to the hallway",
            "at(cup_1) = hallway; at(cup_2) = hallway",
        ),
        (
            "Put the first cup on the locobot and send the locobot to the hallway",
            "at(cup_1) = locobot; at(locobot) = hallway",
        ),
        (
            "Take the first cup out of the locobot's basket and put it on the kitchen table",
            "at(cup_1) = kitchen",
        ),
        (
            "Bring everything to the hallway",
            "at(cup_1) = hallway; at(cup_2) = hallway; at(book) = hallway",
        ),
        ("bring the book or the first cup to the kitchen", "at(book|cup_1) = kitchen"),
        ("bring the HSR the first cup", "at(cup_1) = hsr"),
        ("Send HSR and LoCoBot to the kitchen", "at(hsr) = kitchen; at(locobot) = kitchen"),
        ("HSR, go to the kitchen, then go to the hallway", "at(hsr) = kitchen > at(hsr) = hallway"),
        (
            "HSR, go to the kitchen. Bring the book to the hallway",
            "at(hsr) = kitchen; at(book) = hallway",
        ),
        ("give the hsr the book", "at(book) = hsr"),
        ("put the book back where it belongs", "at(book) = living_room"),
        ("put the book back in the kitchen", "at(book) = kitchen"),
        ("HSR should go to the kitchen.", "at(hsr) = kitchen"),
        ("The hsr must drive to the lounge", "at(hsr) = living_room"),
        ("the locobot has to go to the kitchen", "at(locobot) = kitchen"),
        ("the locobot is to go to the kitchen", "at(locobot) = kitchen"),
        (
            "HSR, patrol the kitchen, the hallway and the kitchen.",
            "at(hsr) = kitchen > at(hsr) = hallway > at(hsr) = kitchen",
        ),
        (
            "The locobot should patrol the kitchen and the hallway",
            "at(locobot) = kitchen > at(locobot) = hallway",
        ),
        (
            "HSR, go to the kitchen, then patrol the hallway and the lounge",
            "at(hsr) = kitchen > at(hsr) = hallway > at(hsr) = living_room",
        ),
        ("A robot should patrol the kitchen", "searched(kitchen)"),
        (
            "Have a look round the whole flat.",
            "searched(kitchen); searched(living_room); searched(hallway)",
        ),
        (
            "look around the apartment",
            "searched(kitchen); searched(living_room); searched(hallway)",
        ),
        ("look round everywhere", "searched(kitchen); searched(living_room); searched(hallway)"),
        ("Go to the kitchen and have a look round", "searched(kitchen)"),
        ("The red book belongs in the kitchen.", "at(book) = kitchen"),
        ("Both cups belong in the hallway", "at(cup_1) = hallway; at(cup_2) = hallway"),
        (
            "The book belongs in the kitchen and the first cup in the hallway",
            "at(book) = kitchen; at(cup_1) = hallway",
        ),
    ],
)
def test_goals_are_understood(text: str, expected: str) -> None:
    assert shown(read_goal(text, WORDS)) == expected


def test_the_first_stage_alone() -> None:
    conditions = read_goal("Bring cup 1 to the hallway, then find cup 2", WORDS).stages[0]
    assert [str(c) for c in conditions] == ["at(cup_1) = hallway"]


def test_where_something_comes_from_is_presumed_and_no_part_of_the_goal() -> None:
    reading = read_goal("Take cup 1 from the kitchen to the hallway", WORDS)
    assert reading.presumed == ((("at", "cup_1"), "kitchen"),)
    assert shown(reading) == "at(cup_1) = hallway"


def test_a_remark_is_kept_apart() -> None:
    reading = read_goal("I have a headache, please bring the book to the kitchen", WORDS)
    assert shown(reading) == "at(book) = kitchen"
    assert reading.remarks == ("I have a headache",)
    after = read_goal("Bring the book to the kitchen. I am so tired!", WORDS)
    assert after.remarks == ("I am so tired",)
