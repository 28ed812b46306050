"""Whom and what goals refer to: told apart by place, use, name and number."""

from __future__ import annotations

from dataclasses import replace

import pytest
from msgspec import structs

from fleet.errors import NotUnderstood
from fleet.language import Vocabulary, read_goal
from keyexpr_schema.payloads.world import Object
from tests.support.language_house import OBJECTS, PLACES, ROBOTS, WORDS, shown


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Bring the cup in the kitchen to the hallway", "at(cup_1) = hallway"),
        ("Bring all cups from the living room to the hallway", "at(cup_2) = hallway"),
        ("Bring a cup from the living room to the hallway", "at(cup_2) = hallway"),
        (
            "Bring everything in the living room to the hallway",
            "at(cup_2) = hallway; at(book) = hallway",
        ),
        ("Pick up the cup that is on the kitchen table", "held(cup_1)"),
        ("Tidy up the living room.", "at(cup_2) = kitchen"),
        ("Clean up in the living room", "at(cup_2) = kitchen"),
        ("Tidy up", "at(cup_1) = kitchen; at(cup_2) = kitchen; at(book) = living_room"),
        ("Tidy up every room", "at(cup_1) = kitchen; at(cup_2) = kitchen; at(book) = living_room"),
    ],
)
def test_beliefs_tell_things_apart_by_where_they_are(text: str, expected: str) -> None:
    beliefs = {"cup_1": "kitchen", "cup_2": "living_room", "book": "living_room"}
    words = Vocabulary(WORDS.places, WORDS.objects, WORDS.robots, beliefs)
    assert shown(read_goal(text, words)) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Scout should go to the kitchen.", "at(scout) = kitchen"),
        ("Scout, go to the kitchen", "at(scout) = kitchen"),
        ("Scout is to be in the kitchen", "at(scout) = kitchen"),
        (
            "Send the hsr and Scout to the kitchen",
            "at(hsr) = kitchen; at(scout) = kitchen",
        ),
        (
            "Scout, patrol the kitchen and the hallway",
            "at(scout) = kitchen > at(scout) = hallway",
        ),
        ("Scout patrols the kitchen", "at(scout) = kitchen"),
        ("Scout the kitchen", "searched(kitchen)"),
    ],
)
def test_a_robot_may_be_called_like_a_verb(text: str, expected: str) -> None:
    scout = structs.replace(ROBOTS[1], robot="scout", label="Scout")
    words = Vocabulary(WORDS.places, WORDS.objects, {"hsr": ROBOTS[0], "scout": scout})
    assert shown(read_goal(text, words)) == expected


def test_one_robot_is_any_robot() -> None:
    words = Vocabulary(WORDS.places, WORDS.objects, {"hsr": ROBOTS[0]})
    assert shown(read_goal("Go to the kitchen", words)) == "at(hsr) = kitchen"
    assert shown(read_goal("HSR, bring the book to the kitchen", words)) == "at(book) = kitchen"


def test_one_cup_is_any_cup() -> None:
    words = Vocabulary(WORDS.places, {"cup_1": OBJECTS[0]}, WORDS.robots)
    for text in ("Bring a cup to the hallway", "Bring the cup to the hallway"):
        assert shown(read_goal(text, words)) == "at(cup_1) = hallway"


def test_names_win_over_grammar() -> None:
    odd = [
        ("to_go", "Drop and pick up point"),
        ("lab", "Robot lab 2"),
    ]
    places = {n: PLACES[0].__class__(place=n, label=label) for n, label in odd}
    words = Vocabulary({**WORDS.places, **places}, WORDS.objects, WORDS.robots)
    text = "Bring the book to the drop and pick up point and the first cup to robot lab 2"
    assert shown(read_goal(text, words)) == "at(book) = to_go; at(cup_1) = lab"


TRAY = Object(object="tray", kind="tray", label="tea tray", home="kitchen", categories=("dish",))
HOUSEHOLD = Vocabulary(
    WORDS.places,
    {
        "tray": TRAY,
        "novel": Object(object="novel", kind="book", label="novel", uses=("read",), home="hallway"),
        "atlas": Object(object="atlas", kind="book", label="atlas", ordinal=2, uses=("read",)),
        "milk": Object(object="milk", kind="carton", label="carton of milk", uses=("drink",)),
        "plate": Object(
            object="plate", kind="plate", label="plate", home="kitchen", categories=("dish",)
        ),
    },
    WORDS.robots,
    {"tray": "living_room", "novel": "living_room", "plate": "living_room", "atlas": "hallway"},
    {"tray": "coffee_table", "novel": "coffee_table", "plate": "floor"},
)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Bring something to read to the kitchen", "at(novel|atlas) = kitchen"),
        ("Bring a book to read to the kitchen", "at(novel|atlas) = kitchen"),
        ("Bring something to drink to the kitchen", "at(milk) = kitchen"),
        ("Bring the carton of milk to the kitchen", "at(milk) = kitchen"),
        ("Bring all dishes to the kitchen", "at(plate) = kitchen; at(tray) = kitchen"),
        ("Get me something to read. The atlas in the kitchen would do.", "at(atlas) = kitchen"),
        ("Bring me a book to the kitchen. The novel is fine.", "at(novel) = kitchen"),
        ("Clear the coffee table", "at(tray) = kitchen; at(novel) = hallway"),
        ("Tidy up the coffee table", "at(tray) = kitchen; at(novel) = hallway"),
        (
            "Put everything on the coffee table in the hallway",
            "at(tray) = hallway; at(novel) = hallway",
        ),
        ("Clear off the coffee table", "at(tray) = kitchen; at(novel) = hallway"),
    ],
)
def test_what_things_are_for_and_lie_on_tells_them_apart(text: str, expected: str) -> None:
    assert shown(read_goal(text, HOUSEHOLD)) == expected


def test_the_other_one_of_a_kind_is_no_other_dish() -> None:
    text = "Bring the novel to the kitchen and the other one to the hallway"
    assert shown(read_goal(text, HOUSEHOLD)) == "at(novel) = kitchen; at(atlas) = hallway"


def test_where_it_is_not_known_what_a_thing_lies_on_nothing_is_left_behind() -> None:
    words = replace(HOUSEHOLD, rests={"tray": "coffee_table"})
    for text in ("Clear the coffee table", "Bring everything on the coffee table to the hallway"):
        with pytest.raises(NotUnderstood, match="whether novel or plate lies on coffee_table"):
            read_goal(text, words)


def test_what_cannot_go_anywhere_is_not_cleared_away() -> None:
    words = replace(HOUSEHOLD, rests={**HOUSEHOLD.rests, "atlas": "hallway_table"})
    with pytest.raises(NotUnderstood, match="atlas has no home in another place"):
        read_goal("Clear the hallway table", words)


def test_something_in_every_room_is_something_else_in_each() -> None:
    places = {name: WORDS.places[name] for name in ("kitchen", "hallway")}
    words = Vocabulary(places, WORDS.objects, WORDS.robots)
    expected = "at(hsr|locobot) = hallway; at(hsr|locobot) = kitchen"
    assert shown(read_goal("Send a robot to every room", words)) == expected
    assert shown(read_goal("There should be a robot in each room", words)) == expected
    with pytest.raises(NotUnderstood, match="say which"):
        read_goal("Bring the book to every room", words)
