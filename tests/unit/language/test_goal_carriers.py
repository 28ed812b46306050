"""Sentences about what is on, in and at other things, about people, and about what opens."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fleet.errors import NotUnderstood
from fleet.language import read_goal, statement_facts
from keyexpr_schema.payloads.world import Feature, Object, Place
from tests.support.language_flat import FURNISHED
from tests.support.language_house import shown


def read(text: str, speaker: str | None = None) -> str:
    return shown(read_goal(text, replace(FURNISHED, speaker=speaker)))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Set the lamp on the shelf", "on(lamp) = shelf"),
        ("Put the lamp on the upper board", "on(lamp) = shelf_board_1"),
        ("Put the fork in the bowl", "in(fork) = bowl"),
        ("Put the first cup into the fridge", "in(cup_1) = fridge"),
        ("Put the fork in the box", "in(fork) = box"),
        ("Put the fork on the box", "on(fork) = box"),
        ("Put the fork on top of the box", "on(fork) = box"),
        ("Put the fork inside of the box", "in(fork) = box"),
        ("Bring the fork to the box", "at(fork) = box"),
        ("Bring the fork to the kitchen table", "on(fork) = kitchen_table"),
        ("Put the fork on the table in the living room", "on(fork) = coffee_table"),
        ("Put the fork on the tray", "on(fork) = tray_1"),
        ("Put a cup on every table",
         "on(cup_1|cup_2) = coffee_table; on(cup_1|cup_2) = kitchen_table"),
        ("Put the cup from the fridge on the kitchen table", "on(cup_2) = kitchen_table"),
        ("Bring the cup in the fridge to the hallway", "at(cup_2) = hallway"),
        ("Bring the cup on the table in the kitchen to the hallway", "at(cup_1) = hallway"),
        ("Bring the lamp to the kitchen and put it on the kitchen table",
         "on(lamp) = kitchen_table"),
        ("The fork should be in the bowl", "in(fork) = bowl"),
        ("Make sure that the fork is on the kitchen table", "on(fork) = kitchen_table"),
        ("Give the first cup to Anna", "at(cup_1) = anna"),
        ("Give Anna the first cup", "at(cup_1) = anna"),
        ("Hand the fork over to Anna", "at(fork) = anna"),
        ("Bring Anna the fork", "at(fork) = anna"),
        ("Send a robot to Anna", "at(hsr|locobot) = living_room"),
        ("Go to the fridge", "at(hsr|locobot) = kitchen"),
        ("Put the lamp back", "on(lamp) = shelf_board_1"),
        ("Put the cups away", "in(cup_1) = cupboard; in(cup_2) = cupboard"),
        ("Clear the kitchen table", "in(cup_1) = cupboard"),
        ("Search the fridge", "searched(fridge)"),
        ("Look into the cupboard", "searched(cupboard)"),
        ("Search the coffee table", "searched(living_room)"),
        ("Look for the fork in the fridge", "searched(fridge); located(fork)"),
        ("Put the fork on the bowl", "in(fork) = bowl"),
        ("Tidy up the kitchen table", "in(cup_1) = cupboard"),
        ("Tidy up the living room", "on(lamp) = shelf_board_1"),
        ("The kitchen should be searched", "searched(kitchen)"),
        ("Open the fridge", "is_open(fridge)"),
        ("Close everything", "is_open(fridge) = False; is_open(cupboard) = False"),
        ("Switch on the lamp", "is_on(lamp)"),
        ("Switch the lamp off", "is_on(lamp) = False"),
        ("Turn on the television", "is_on(television)"),
        ("Shut the fridge", "is_open(fridge) = False"),
        ("The fridge should be closed", "is_open(fridge) = False"),
        ("Make sure that the cupboard is open", "is_open(cupboard)"),
        ("The lamp should be on", "is_on(lamp)"),
        ("Put the fork in the fridge and close the fridge",
         "in(fork) = fridge; is_open(fridge) = False"),
        ("Put the fork on the tray, then bring the tray to the hallway",
         "on(fork) = tray_1 > at(tray_1) = hallway"),
    ],
)  # fmt: skip
def test_goals_keep_the_finest_place_that_is_named(text: str, expected: str) -> None:
    assert read(text) == expected


@pytest.mark.parametrize(
    "text", ["Bring me the fork", "Bring the fork to me", "Give me the fork", "Get me the fork"]
)
def test_me_is_the_speaker_of_the_goal(text: str) -> None:
    assert read(text, "anna") == "at(fork) = anna"
    with pytest.raises(NotUnderstood):
        read(text)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("Put the lamp on the television", "nothing can be put on or in television"),
        ("Put the fork on the last cup", "nothing can be put on or in cup_2"),
        ("Put the fork on the fridge", "nothing can be put on fridge, only in it"),
        ("Put the bowl in the bowl", "nothing can be on or in itself"),
        ("Bring the television to the kitchen", "television cannot be moved"),
        ("Bring Anna to the kitchen", "anna cannot be moved"),
        ("Put the lamp and the box in the box", "nothing can be on or in itself"),
        ("Give the fork to the bowl", "'bowl' is no robot or person"),
        ("Open the lamp", "lamp cannot be opened"),
        ("Switch on the fork", "fork cannot be switched on"),
        ("Put the fork on the kitchen table and in the bowl", "two places"),
    ],
)
def test_what_cannot_be_is_refused(text: str, reason: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read(text)
    assert reason in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("The fork is in the bowl", "at(fork) = bowl"),
        ("The lamp is on the shelf", "at(lamp) = shelf"),
        ("There is a fork on the table in the kitchen", "at(fork) = kitchen_table"),
        ("Anna is in the kitchen", "at(anna) = kitchen"),
        ("The robot hsr is at the fridge", "at(hsr) = kitchen"),
        ("The kitchen has been searched", "searched(kitchen) = true"),
        ("The fridge is open", "is_open(fridge) = true"),
        ("The cupboard is closed and the lamp is on",
         "is_open(cupboard) = false; is_on(lamp) = true"),
        ("Anna has the fork", "at(fork) = anna"),
        ("The fridge contains the first cup", "at(cup_1) = fridge"),
    ],
)  # fmt: skip
def test_statements_keep_the_finest_place_that_is_named(text: str, expected: str) -> None:
    assert "; ".join(map(str, statement_facts(text, FURNISHED))) == expected


@pytest.mark.parametrize(
    ("text", "robots"),
    [
        ("Charge hsr.", "hsr"),
        ("Recharge the hsr", "hsr"),
        ("Charge hsr up", "hsr"),
        ("hsr shall charge.", "hsr"),
        ("Send hsr to charge", "hsr"),
        ("hsr must be charged", "hsr"),
        ("Charge hsr and locobot", "hsr locobot"),
        ("Charge all robots", "hsr locobot"),
        ("Charge hsr or locobot", "hsr|locobot"),
    ],
)
def test_a_robot_is_named_before_or_behind_what_it_does_with_itself(text: str, robots: str) -> None:
    assert read(text) == "; ".join(f"charge({robot}) = 100" for robot in robots.split())


@pytest.mark.parametrize(
    "text", ["Charge the first cup", "Charge hsr in the kitchen", "Let hsr charge locobot"]
)
def test_what_robots_do_with_themselves_is_done_to_nothing_else(text: str) -> None:
    with pytest.raises(NotUnderstood, match="a robot does that with itself; name the robot, and"):
        read(text)


def test_a_numbered_name_without_its_number_is_asked_about_and_is_no_place_beside_it() -> None:
    tables = {
        f"packing_table_{n}": Object(
            object=f"packing_table_{n}", kind="table", home="packing", movable=False,
            label=f"packing table {n}", features=(Feature.SUPPORTS,),
        )
        for n in (1, 2)
    }  # fmt: skip
    packing = Place(place="packing", label="Packing")
    words = replace(
        FURNISHED,
        places={**FURNISHED.places, "packing": packing},
        objects={**FURNISHED.objects, **tables},
    )
    asks = "could be packing_table_1 or packing_table_2: say which"
    with pytest.raises(NotUnderstood, match=asks):
        read_goal("Bring the fork to the packing table", words)
    assert shown(read_goal("Bring the fork to packing", words)) == "at(fork) = packing"
    found = read_goal("Bring the fork to packing table 2", words)
    assert shown(found) == "on(fork) = packing_table_2"
