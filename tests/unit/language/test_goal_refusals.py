"""Goals that are refused, and the sentences that say why."""

from __future__ import annotations

import pytest

from fleet.errors import NotUnderstood
from fleet.language import Vocabulary, read_goal
from tests.support.language_house import WORDS


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "the sentence is empty"),
        ("...", "the sentence is empty"),
        ("Bring the third cup to the hallway", "there is no 'the third cup'"),
        ("Bring the cup to the hallway", "'the cup' could be cup_1 or cup_2: say which object"),
        ("Bring the first cup to the attic", "'the attic' is not a known place"),
        ("Sing a song", "'Sing' is not understood as a goal"),
        ("Bring the first cup to the hallway and dance", "'dance' is not understood as a goal"),
        (
            "Bring cup 1 to the hallway and cup 1 to the kitchen",
            "it wants cup_1 in two places: hallway and kitchen",
        ),
        ("Pick it up", "'it' refers to nothing before it: name what you mean"),
        (
            "clean up the hallway",
            "nothing that belongs elsewhere is believed to be in hallway: have it searched first",
        ),
        ("The cup should be in the hallway", "'The cup' could be cup_1 or cup_2: say which object"),
        (
            "Don't bring the cup to the hallway",
            '"Don\'t" says what must not be, or leaves something out',
        ),
        ("Bring the book to the hallway at 5 pm", "'pm' names a time, which a goal cannot"),
        (
            "Bring the book to the hallway in ten minutes",
            "'minutes' names a time, which a goal cannot",
        ),
        (
            "If the cup is in the kitchen, bring it to the hallway",
            "'If' makes it depend on something else, which a goal cannot",
        ),
        ("Bring three cups to the hallway", "'three cups': there are only 2"),
        (
            "Bring the book to the hallwy",
            "'the hallwy' is not a known place (did you mean 'hallway'?)",
        ),
        (
            "Put the book on the table",
            "'the table' could be living_room, hallway or kitchen: say which place",
        ),
        (
            "Bring the other cup to the hallway",
            "'the other cup' could be cup_1 or cup_2: call it by its name",
        ),
        (
            "Bring the book to the kitchen and the hallway",
            "'the hallway' is one place too many for one thing",
        ),
        ("HSR, bring the book to the kitchen", "hsr cannot be told to do it"),
        ("Bring the fridge to the hallway", "'the fridge': fridge cannot be moved"),
        (
            "Is the cup in the kitchen?",
            "'Is the cup in the kitchen?' is a question; a goal says what should hold",
        ),
        (
            "The first cup is in the kitchen",
            "'The first cup is in the kitchen' states a fact; a goal says what should be",
        ),
        ("Go to the room", "'the room' could be hallway, kitchen or living_room: say which place"),
        ("fetch the book", "it does not say where to bring book"),
        (
            "brign the book to the kitchen",
            "'brign' is not understood as a goal (did you mean 'bring'?)",
        ),
        ("Bring cups to the lounge", "'cups' does not say how many: say all of them or which ones"),
        (
            "Bring some cups to the lounge",
            "'some cups' does not say how many: say all of them or which ones",
        ),
        ("bring the red to the lounge", "'the red' could be book or cup_1: say which object"),
        (
            "Send a robot to the kitchen and a robot to the hallway and a robot to the living room",
            "it wants more of hsr or locobot than there are",
        ),
        (
            "Bring the cup in the kitchen to the hallway",
            "'the cup' could be cup_1 or cup_2: say which object",
        ),
        (
            "Bring all cups from the kitchen to the hallway",
            "it is not known which of cup_1 or cup_2 are in kitchen: name them",
        ),
        (
            "Bring the book to the kitchen or the hallway",
            "'or' leaves a choice that cannot be left open",
        ),
        (
            "Bring the book to me",
            "'me' names somebody whose place is not known; name a place or a robot",
        ),
        ("Bring me the book", "'Bring me the book' does not say where to"),
        (
            "bring the book here",
            "'here' names somebody whose place is not known; name a place or a robot",
        ),
        (
            "send the hsr to the kitchen and bring it to the hallway",
            "it wants hsr in two places: kitchen and hallway",
        ),
        ("bring   the\tbook to", "'bring the book to' ends where a place is missing"),
        (
            "bring the book carefully to the kitchen",
            "'carefully' says how it is to be done, which a goal cannot: leave it out",
        ),
        (
            "bring the book to the kitchen carefully",
            "'carefully' says how it is to be done, which a goal cannot: leave it out",
        ),
        (
            "Bring the book to every room",
            "'every room' could be hallway, kitchen or living_room: say which",
        ),
        ("go home", "a robot has no home: name the place where it shall go"),
        (
            "grab a cup and go to the hallway",
            'it does not say whether cup_1 or cup_2 goes along: say "bring … to …"',
        ),
        (
            "make sure the book isn't in the kitchen",
            '"isn\'t" says what must not be, or leaves something out',
        ),
        ("put the book next to the first cup", "'next to' names a relation that is not known"),
        ("put the book on the first cup", "'the first cup' is not a known place"),
        ("Bring the book to the sofa", "'the sofa' is not a known place"),
        ("go to the kitchen and the hallway", "'the hallway' is one place too many for one thing"),
        (
            "Bring the first cup to the hallway and it should be in the kitchen",
            "it wants cup_1 in two places: hallway and kitchen",
        ),
        (
            "bring a cup from the kitchen to the hallway",
            "it is not known which of cup_1 or cup_2 are in kitchen: name them",
        ),
        ("bring the book from the attic to the hallway", "'the attic' is not a known place"),
        ("and", "'and' ends before it says what to do"),
        ("then", "'then' ends before it says what to do"),
        ("please", "'please' ends before it says what to do"),
        (
            "Bring the book to the kitchen and",
            "'Bring the book to the kitchen and' ends before it says what to do",
        ),
        (
            "Bring the book to the kitchen twice",
            "'twice' asks for repetition, which a goal cannot: give it again when it was reached",
        ),
        ("bring all 3 cups to the kitchen", "'all 3 cups': there are only 2"),
        ("get rid of the book", "no bin is known to throw it into"),
        (
            "bring the first elf to the kitchen",
            "'the first elf' is not a known object; known",
        ),
        ("bring all dragons to the kitchen", "'all dragons' is not a known object"),
        (
            "Pick up the book, then go to the hallway",
            'it does not say whether book goes along: say "bring … to …"',
        ),
        (
            "bring the book upstairs",
            "'upstairs' is not understood after 'bring the book'",
        ),
        ("where is the hsr", "'the hsr': robots say themselves where they are; see their states"),
        ("find the hsr", "'the hsr': robots say themselves where they are; see their states"),
        (
            "bring everything in the kitchen to the hallway",
            "it is not known which of cup_1, cup_2 or book are in kitchen: name them",
        ),
        (
            "tidy up everything in the kitchen",
            "it is not known which of cup_1, cup_2 or book are in kitchen: name them",
        ),
        (
            "bring the book to the kitchen before the cup",
            "'before' makes it depend on something else, which a goal cannot",
        ),
        ("bring a book to a room", "'a room' could be hallway, kitchen or living_room: say which"),
        (
            "bring the book to the kitchen with the hsr",
            "hsr cannot be told to do it",
        ),
        ("put the book down", "'put the book down' does not say where to"),
        ("send the robot to the kitchen", "'the robot' could be hsr or locobot: say which robot"),
        (
            "the robot should go to the kitchen",
            "'the robot' could be hsr or locobot: say which robot",
        ),
        (
            "HSR, go to the kitchen and get the first cup to the hallway",
            "hsr cannot be told to do it",
        ),
        ("HSR, go to the kitchen and bring the book to the hallway", "hsr cannot be told to do it"),
        ("5 robots, bring the book to the hallway", "hsr and locobot cannot be told to do it"),
        ("the 5 second cup to the kitchen", "'the 5 second cup' is not understood as a goal"),
        ("Put the book in the hallway on the 5 table", "'the 5 table': there is only 1"),
        (
            "Hand the first cup home to the locobot",
            "'Hand the first cup home to the locobot' names a place and says",
        ),
        ("HSR, patrol", "it does not say where to look around: name a place"),
        ("HSR, patrol the kitchen or the hallway", "it does not say which place"),
        (
            "HSR, patrol the kitchen for the book",
            "'for the book' is not understood after 'HSR, patrol the kitchen'",
        ),
        (
            "HSR and locobot, patrol the kitchen and the hallway",
            "does not say which robot goes where: say it of one robot at a time",
        ),
        ("HSR, search the kitchen", "hsr cannot be told to do it"),
        ("have a look round", "it does not say where to look around"),
        ("The book belongs to the locobot", "does not say in which place it belongs"),
        ("The book does not belong in the kitchen", "'not' says what must not be"),
        ("The fridge belongs in the hallway", "'The fridge': fridge cannot be moved"),
        ("The kitchen belongs in the hallway", "places stay where they are"),
        ("The book belongs", "'The book belongs' does not say where to"),
        (
            "Clear the coffee table.",
            "nothing is believed to lie on coffee_table: have living_room searched first",
        ),
        ("Tidy up the coffee table", "nothing is believed to lie on coffee_table"),
        (
            "Empty the kitchen",
            "'Empty the kitchen': name the things and where to bring them, or say "
            '"tidy up kitchen"',
        ),
        ("I have a headache.", "'headache' in 'I have a headache' says how something is"),
        (
            "I have no time. Bring the book to the kitchen.",
            "'I have no time' is no goal, and may matter: leave it out, or tell it as a fact",
        ),
        (
            "I am in the kitchen. Bring the book to the hallway.",
            "'kitchen' is spoken of in 'I am in the kitchen', which is no goal",
        ),
        (
            "I have the book. Bring it to the kitchen.",
            "'book' is spoken of in 'I have the book', which is no goal",
        ),
        ("I have to leave. Bring the book to the kitchen.", "'I' is not understood as a goal"),
        ("Quickly bring the book to the kitchen", "'Quickly' says how it is to be done"),
        ("Use the hsr to bring the book to the kitchen", "hsr cannot be told to do it"),
        ("I am thirsty", "'thirsty' in 'I am thirsty' says how something is"),
        (
            "bring a cup to the kitchen and a cup to the kitchen",
            "it wants one of cup_1 or cup_2 in kitchen more than once: say how many",
        ),
        (
            "bring both cups to the kitchen and another cup to the hallway",
            "'another cup' could be cup_1 or cup_2: call it by its name",
        ),
        (
            "put a cup in every room",
            "'every room' are 3, and there are only 2 for them: cup_1 or cup_2",
        ),
        ("Bring something to drink to the hallway", "'something to drink': nothing of that kind"),
        ("Bring something to hallwy", "'hallwy' is not a known place (did you mean 'hallway'?)"),
        ("A cup in the hallway would do", "nothing was asked for before that it could do for"),
        (
            "Bring the red cups and books except the fridge to the kitchen",
            "'books': fridge is none of book",
        ),
        ("bring the firts cup to the hallway", "(did you mean 'first'?)"),
    ],
)
def test_what_is_not_understood_is_refused_with_the_reason(text: str, says: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read_goal(text, WORDS)
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_choices_are_listed() -> None:
    with pytest.raises(NotUnderstood, match="known are book, cup_1, cup_2, fridge, hsr, …"):
        read_goal("Bring the dragon to the hallway", WORDS)


@pytest.mark.parametrize("text", ["Bring the cup to the kitchen", "Go to the kitchen", "Tidy up"])
def test_where_nothing_is_known_everything_is_refused(text: str) -> None:
    with pytest.raises(NotUnderstood):
        read_goal(text, Vocabulary({}, {}, {}))


@pytest.mark.parametrize(
    ("text", "tidy"),
    [
        ("Tidy up the kitchen", "kitchen"),
        ("Tidy up the kitchen and the living room", "kitchen"),
        ("Tidy up the hallway and the kitchen", "hallway or kitchen"),
    ],
)
def test_a_place_is_tidied_of_what_is_believed_to_be_there(text: str, tidy: str) -> None:
    beliefs = {"cup_1": "kitchen", "cup_2": "living_room", "book": "living_room"}
    words = Vocabulary(WORDS.places, WORDS.objects, WORDS.robots, beliefs)
    with pytest.raises(NotUnderstood, match=f"is believed to be in {tidy}: have it searched"):
        read_goal(text, words)


def test_tidying_needs_homes() -> None:
    homeless = {"fridge": WORDS.objects["fridge"]}
    with pytest.raises(NotUnderstood, match='give it one with the field "home"'):
        read_goal("Tidy up", Vocabulary(WORDS.places, homeless, WORDS.robots))
