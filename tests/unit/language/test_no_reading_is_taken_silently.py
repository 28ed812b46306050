"""Readings that once were taken for something else, without a word."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest

from benchmarks.language.reader import vocabulary_of
from fleet.errors import NotUnderstood
from fleet.language import Ambiguity, Reading, read

NOW = datetime(2026, 3, 4, 9, 30, tzinfo=UTC)


def said(text: str, world: str = "house") -> Reading:
    found = read(text, vocabulary_of(world), NOW)
    assert isinstance(found, Reading), found
    return found


def test_two_robots_that_are_told_two_things_are_two_goals() -> None:
    goals = said("Let Rosie fold the blanket and Dusty vacuum the hallway.").goals
    assert {goal.by for goal in goals} == {("rosie",), ("dusty",)}


def test_parts_with_times_of_their_own_are_goals_of_their_own() -> None:
    goals = said("Water the fern at 5 pm and close the bedroom window at 6 pm.").goals
    assert sorted(goal.not_before_s or 0.0 for goal in goals) == [27000.0, 30600.0]


def test_who_is_sent_somewhere_to_do_something_does_it_after_that() -> None:
    (goal,) = said("Rosie, go to the kitchen and fetch me the cola.").goals
    assert [stage[0].subject for stage in goal.stages] == ["rosie", "cola"]


def test_everything_somewhere_is_not_everything() -> None:
    wanted = said("Clear away everything that's on the dining table.").stages[0]
    assert {c.subject for c in wanted} == {"plate_2", "butter_knife", "candle", "vase"}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("At 5 pm. Water the fern.", "nothing is to be done then"),
        ("put the apple on the tray on the dining table", "names two places"),
        ("bring everything to the garage", "would be"),
        ("Where is the tv and is it on? Where is the radio?", ""),
    ],
)
def test_what_would_be_lost_is_refused(text: str, told: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read(text, vocabulary_of("house"), NOW)
    assert told in str(refused.value)


@pytest.mark.parametrize("text", ["Open the fridge and the cupboard, and put the milk in there."])
def test_what_the_plainest_reading_leaves_open_is_asked(text: str) -> None:
    assert isinstance(read(text, vocabulary_of("house"), NOW), Ambiguity)


def test_a_question_keeps_the_words_for_states_and_places() -> None:
    question = said("How many of the clean plates are in the cupboard?").question
    assert question is not None
    assert {c.relation for c in question.holds} == {"clean", "in"}


@pytest.mark.parametrize(
    ("world", "text", "told"),
    [
        ("house", "Bring the car to Ben.", "'the car' is not a known object; known are car_key"),
        ("house", "Bring me the butter.", "known are butter_knife"),
        ("house", "Bring the red mug to Ben without coffee.", "'coffee'"),
        ("house", "Rosie may wash the red mug.", "asks for nothing"),
        ("house", "The novel belongs to Ben.", "whose it is"),
        ("house", "The TV was on.", "tells of the past"),
        ("house", "Turn off the TV in the bedroom.", "tv is in living_room"),
        ("house", "Open the fridge and bring it to Ben.", "cannot be moved"),
        ("house", "Always close the front door after opening it.", "always, and then"),
        ("house", "Vacuum the sofa.", "sofa is no place"),
        ("house", "Vacuum under the bed.", "ends where a place is missing"),
        ("house", "Charge his phone.", "'his' refers to nobody"),
        ("house", "Bring Ben her phone.", "known to be ben's"),
        ("house", "Turn on the TV off.", "ends where an object is missing"),
        ("house", "Bring me at most two apples.", "'most'"),
        ("warehouse", "Bring pallet 1 to 2.", "nothing can be put"),
        ("apartment", "Patrol the kitchen, then return.", "does not say what to return"),
    ],
)
def test_what_people_mean_otherwise_is_refused(world: str, text: str, told: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read(text, vocabulary_of(world), NOW)
    assert told in str(refused.value)


def test_what_ends_with_a_question_mark_is_no_fact() -> None:
    found = said("The front door is locked?")
    assert not found.facts
    assert found.question is not None


def test_a_count_is_of_those_that_are_where_it_is_said() -> None:
    wanted = said("Bring two chairs from the dining room to the kitchen.").goals[0].stages[0]
    assert {c.subjects for c in wanted} == {("chair_1",), ("chair_2",)}


def test_a_whole_apple_is_not_a_sliced_one() -> None:
    (wanted,) = said("Bring me a whole apple.").goals[0].stages[0]
    assert wanted.subjects == ("apple_1", "apple_2")


def test_the_second_drawer_of_several_cupboards_is_asked_about() -> None:
    found = read("Close the second drawer.", vocabulary_of("apartment"), NOW)
    assert isinstance(found, Ambiguity)
    assert len(found.candidates) == 3


def test_what_is_cold_is_told_and_not_remarked() -> None:
    assert said("The soup is cold, could you heat it up?").facts


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("Search open the kitchen.", "'open' is not understood"),
        ("Find the phone off.", "'off' is not understood"),
        ("Tidy up the kitchen off.", "'off' is not understood"),
        ("The living room is a mess, tidy it zorgle.", "'zorgle'"),
        ("The living room needs tidying zorgle.", "'zorgle'"),
        ("Clear the coffee table zorgle.", "'zorgle'"),
        ("Enter the oven.", "no place that a robot can go into"),
        ("Go to the kitchen 7.", "7"),
        ("Rosie must not open the oven.", "to all robots only"),
        ("Never go to the kitchen under the bed.", "'under'"),
        ("Avoid the sofa.", "no place that a robot can be in"),
    ],
)
def test_no_word_beside_a_verb_is_lost(text: str, told: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read(text, vocabulary_of("house"), NOW)
    assert told in str(refused.value)


def test_entering_is_being_there() -> None:
    ((wanted,),) = said("Enter the kitchen.").goals[0].stages
    assert (wanted.relation, wanted.value) == ("at", "kitchen")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("Is the milk cold and the juice warm?", "asks two things"),
        ("Should Dusty vacuum the hallway?", "asks what shall be done"),
        ("Shall Rosie close the oven?", "asks what shall be done"),
    ],
)
def test_a_question_is_no_goal(text: str, told: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read(text, vocabulary_of("house"), NOW)
    assert told in str(refused.value)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("Put the novel on the sofa back.", "on(novel) = bookshelf"),
        ("Put the hammer in the garden away.", "in(hammer) = toolbox"),
        ("Put the milk back in the fridge.", "in(milk) = fridge"),
        ("Bring back the novel.", "on(novel) = bookshelf"),
    ],
)
def test_back_and_away_behind_a_place_say_home(text: str, wanted: str) -> None:
    ((found,),) = said(text).goals[0].stages
    assert str(found) == wanted


@pytest.mark.parametrize(
    ("text", "left_out"),
    [
        ("Bring all toys but the doll from the kids room to the living room.", "red_ball"),
        ("Bring all toys but the doll from the kids room to the living room.", "doll"),
        ("Bring all toys except the one in the garden to the living room.", "red_ball"),
    ],
)
def test_what_is_left_out_is_one_of_those(text: str, left_out: str) -> None:
    wanted = {c.subject for c in said(text).goals[0].stages[0]}
    assert left_out not in wanted
    assert {"blue_ball", "red_block"} <= wanted


@pytest.mark.parametrize(
    "text", ["Bring me something to write on.", "Bring the visitor a coffee, black."]
)
def test_a_word_behind_a_noun_is_neither_lost_nor_a_thing(text: str) -> None:
    with pytest.raises(NotUnderstood):
        read(text, vocabulary_of("office"), NOW)
