"""Laws of reading sentences: total, blind to case and politeness, and nothing is dropped."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.errors import NotUnderstood
from fleet.language import Reading, Vocabulary, read, read_goal, statement_facts
from fleet.language.words.tokens import words_in
from fleet.language.words.wordbook import shipped_language
from keyexpr_schema.payloads.world import Feature, Object, Place
from tests.support.household import carrier, manipulator
from tests.support.language_flat import FURNISHED
from tests.support.language_flat_said import SPOKEN
from tests.support.language_house import WORDS as NAMES
from tests.support.language_house import shown
from tests.support.reached import Reached, reaches

WORDS = Vocabulary(NAMES.places, NAMES.objects, NAMES.robots, {"book": "kitchen"})
KNOWN = {*WORDS.places, *WORDS.objects, *WORDS.robots}
COMMON_WORDS = words_in(
    "bring take put find search pick up go send give tidy the a all both one two first second "
    "cup cups book kitchen hallway table hsr locobot robot basket it them there to in on from "
    "and then or , . ? ' of should be is are not if everything other back home please 's make "
    "sure patrol belongs round clear"
)
SOUP = st.lists(st.sampled_from(COMMON_WORDS), max_size=14).map(" ".join)
CLAIM = st.tuples(
    st.sampled_from(("the first cup", "the book", "cup 2", "the hsr", "a cup", "everything")),
    st.sampled_from(("is in", "is on", "is not in", "are in")),
    st.sampled_from(("the kitchen", "the hallway", "the locobot", "the kitchen table", "it")),
).map(" ".join)
CLAIMS = st.lists(CLAIM, min_size=1, max_size=3).map(" and ".join)
WISH = st.builds(
    str.format,
    st.sampled_from(("bring {} to the hallway", "find {}", "pick up {}", "put {} in the kitchen")),
    st.sampled_from(("the first cup", "the book", "a cup", "it", "the hsr", "everything")),
)
WISHES = st.lists(WISH, min_size=1, max_size=3).map(" and ".join)
SENTENCES = (
    "Bring the first cup to the hallway and the second cup to the living room",
    "Find a cup and bring it to the hallway, then search the kitchen",
    "Put cups 1 and 2 in the locobot's basket",
    "Go to the kitchen, pick up the red book and put it on the table in the hallway",
    "Send the hsr to the kitchen and a robot to the hallway",
    "Make sure that the book is in the kitchen",
    "Search every room for the book and tidy up the kitchen",
    "The first cup should be in the hallway and the second one in the kitchen",
    "Bring all cups to the hallway and then to the kitchen",
    "HSR, patrol the kitchen, the hallway and the kitchen",
    "The red book belongs in the hallway and the first cup in the kitchen",
    "Have a look round the whole flat",
)
SAID = (
    "Get me the cup in the fridge",
    "Keep the fridge closed and never open the cupboard",
    "If the fridge is open, close it and switch off the lamp",
    "Wash the dirty cup before you bring the fork to the hallway",
    "Bring all cups except the first one to the hallway",
    "The lamp should always be on",
    "HSR, bring the fork to the kitchen table at noon",
)
NOW = datetime(2026, 3, 4, 9, 30, tzinfo=UTC)
UNREADABLE = ("zorgle", "not", "never", "if", "unless", "except", "carefully", "tomorrow", "almost")
NONSENSE = words_in("blick dax wug fep toma modi koba lorp zav nemi rul pim gazzer teeb")


def known_names_only(reading: Reading) -> None:
    assert reading.stages
    for stage in reading.stages:
        assert stage
        for condition in stage:
            assert condition.subject in KNOWN
            assert set(condition.any_of) <= KNOWN
            assert condition.value is True or condition.value in KNOWN


@reaches(least={"refused": 51, "read": 21})
@settings(max_examples=400, deadline=None)
@given(st.one_of(st.text(max_size=60), SOUP, WISHES))
def test_any_text_is_read_or_refused(reached: Reached, text: str) -> None:
    try:
        known_names_only(read_goal(text, WORDS))
    except NotUnderstood as refused:
        reached["refused"] += 1
        assert str(refused)
        assert "\n" not in str(refused)
    else:
        reached["read"] += 1


@reaches(least={"refused": 51, "read": 21})
@settings(max_examples=400, deadline=None)
@given(st.one_of(st.text(max_size=60), SOUP, CLAIMS))
def test_any_statement_is_read_or_refused(reached: Reached, text: str) -> None:
    try:
        facts = statement_facts(text, WORDS)
    except NotUnderstood as refused:
        reached["refused"] += 1
        assert str(refused)
        assert "\n" not in str(refused)
    else:
        reached["read"] += 1
        assert facts
        assert {key.subject for key, _ in facts} <= KNOWN


FURNISHED_WORDS = words_in(
    "bring put set give hand take open close shut switch turn on off in into onto to from of the a "
    "all fork lamp cup first bowl box tray shelf fridge cupboard table television anna kitchen "
    "living room me it and then is should be has contains everything back away look search , . '"
)
FURNISHED_SOUP = st.lists(st.sampled_from(FURNISHED_WORDS), max_size=12).map(" ".join)
THING = st.sampled_from(
    (
        *("the fork", "the lamp", "the first cup", "the bowl", "the box", "the tray", "the fridge"),
        *("Anna", "everything", "it", "the television", "the shelf", "the kitchen table", "me"),
        *("the upper board", "the cups"),
    )
)
FURNISHED_WISH = st.builds(
    str.format,
    st.sampled_from(
        (
            *("put {} on {}", "put {} in {}", "bring {} to {}", "give {} to {}", "close {}"),
            *("switch {} off", "open {}", "put {} back", "clear {}", "search {}", "bring me {}"),
            *("{} should be open", "take {} from {}"),
        )
    ),
    THING,
    THING,
)
FURNISHED_CLAIM = st.builds(
    str.format,
    st.sampled_from(
        ("{} is on {}", "{} is in {}", "{} is open", "{} is off", "{} has {}", "{} contains {}")
    ),
    THING,
    THING,
)
FURNISHED_WISHES = st.lists(FURNISHED_WISH, min_size=1, max_size=2).map(" and ".join)


@reaches("handed", least={"refused": 50, "on or in": 5, "state": 3})
@settings(max_examples=500, deadline=None)
@given(st.one_of(FURNISHED_SOUP, FURNISHED_WISH, FURNISHED_WISHES), st.sampled_from([None, "anna"]))
def test_what_is_wished_for_things_can_be(reached: Reached, text: str, speaker: str | None) -> None:
    """Nothing is put into itself, nor on what only contains, nor moved that stays where it is."""
    try:
        reading = read_goal(text, replace(FURNISHED, speaker=speaker))
    except NotUnderstood as refused:
        reached["refused"] += 1
        assert str(refused)
        assert "\n" not in str(refused)
        return
    for condition in (condition for stage in reading.stages for condition in stage):
        good_for = FURNISHED.good_for.get(str(condition.value), frozenset())
        things = [FURNISHED.objects[s] for s in condition.subjects if s in FURNISHED.objects]
        if condition.relation in ("at", "on", "in"):
            assert condition.value not in condition.subjects
            assert all(thing.is_a(Feature.MOVABLE) for thing in things)
        if condition.relation in ("on", "in"):
            wanted = Feature.SUPPORTS if condition.relation == "on" else Feature.CONTAINS
            assert wanted in good_for
            reached["on or in"] += 1
        if condition.relation in ("is_open", "is_on"):
            wanted = Feature.OPENABLE if condition.relation == "is_open" else Feature.SWITCHABLE
            assert all(thing.is_a(wanted) for thing in things)
            reached["state"] += 1
        reached["handed"] += condition.relation == "at" and condition.value == "anna"


@reaches("refused", "read")
@settings(max_examples=300, deadline=None)
@given(st.one_of(FURNISHED_SOUP, FURNISHED_CLAIM))
def test_any_statement_about_furniture_is_read_or_refused(reached: Reached, text: str) -> None:
    try:
        facts = statement_facts(text, FURNISHED)
    except NotUnderstood as refused:
        reached["refused"] += 1
        assert "\n" not in str(refused)
    else:
        reached["read"] += 1
        assert all(key.subject != value for key, value in facts)


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(SENTENCES), st.sampled_from(UNREADABLE), st.data())
def test_no_word_is_dropped(text: str, extra: str, data: st.DataObject) -> None:
    """A word that the grammar does not know makes a sentence unreadable, wherever it stands."""
    words = text.split()
    at = data.draw(st.integers(0, len(words)))
    changed = " ".join([*words[:at], extra, *words[at:]])
    with pytest.raises(NotUnderstood):
        read_goal(changed, WORDS)


@pytest.mark.parametrize("text", (*SENTENCES, *SAID))
def test_an_unknown_word_is_named(text: str) -> None:
    """A sentence of which a word is not known is refused, and the refusal names that word."""
    words = text.split()
    for at in range(len(words)):
        changed = " ".join([*words[:at], "zorgle", *words[at + 1 :]])
        with pytest.raises(NotUnderstood) as refused:
            read(changed, SPOKEN if text in SAID else WORDS, NOW)
        assert "zorgle" in str(refused.value).casefold()


@st.composite
def slips(draw: st.DrawFn, word: str) -> str:
    """The word with a letter left out, doubled, another one, or swapped with its neighbour."""
    at = draw(st.integers(1, len(word) - 2))
    left, letter, right = word[:at], word[at], word[at + 1 :]
    other = draw(st.sampled_from("abcdefghijklmnopqrstuvwxyz"))
    swapped = left + right[0] + letter + right[1:]
    return draw(
        st.sampled_from([left + right, left + letter * 2 + right, left + other + right, swapped])
    )


@reaches("hinted", "right")
@settings(max_examples=150, deadline=None)
@given(st.sampled_from((*SENTENCES, *SAID)), st.data())
def test_no_hint_leads_elsewhere(reached: Reached, text: str, data: st.DataObject) -> None:
    """What a refusal suggests for a misspelt word means what the right word means, or nothing."""
    words = text.split()
    at = data.draw(st.sampled_from([i for i, word in enumerate(words) if len(word) > 4]))
    typo = data.draw(slips(words[at]))
    vocabulary = SPOKEN if text in SAID else WORDS
    try:
        read(" ".join([*words[:at], typo, *words[at + 1 :]]), vocabulary, NOW)
    except NotUnderstood as refused:
        hint = re.search(r"did you mean '([^']+)'", str(refused))
        if hint is None:
            return
        reached["hinted"] += 1
        try:
            followed = read(" ".join([*words[:at], hint[1], *words[at + 1 :]]), vocabulary, NOW)
        except NotUnderstood:
            return
        right = read(text, vocabulary, NOW)
        assert isinstance(right, Reading)
        assert isinstance(followed, Reading)
        assert followed.goals == right.goals
        reached["right"] += 1


@reaches("refused")
@settings(max_examples=100, deadline=None)
@given(
    st.sampled_from((*SENTENCES, *SAID)),
    st.sampled_from(sorted(shipped_language().everyday)),
    st.sampled_from(["{}", "{}s", "{}ed", "{}ing"]),
    st.data(),
)
def test_what_people_say_is_no_slip_for_something_else(
    reached: Reached, text: str, word: str, form: str, data: st.DataObject
) -> None:
    """A real word that is not known here is never taken for a misspelt one: no hint at all."""
    words = text.split()
    at = data.draw(st.integers(0, len(words) - 1))
    vocabulary = SPOKEN if text in SAID else WORDS
    try:
        read(" ".join([*words[:at], form.format(word), *words[at + 1 :]]), vocabulary, NOW)
    except NotUnderstood as refused:
        reached["refused"] += 1
        assert "did you mean" not in str(refused)
        assert str(refused).partition("known are ")[2].count(", ") <= 5


@settings(max_examples=200, deadline=None)
@given(
    st.sampled_from(SENTENCES),
    st.sampled_from(
        ["{}", "Please {}", "{}, please.", "Could you {}?", "  {}  !", "Hey, {}. Thanks"]
    ),
    st.sampled_from([str, str.lower, str.upper, str.swapcase, str.title]),
    st.sampled_from([" ", "  ", "\t", "\n", "\u00a0"]),
)
def test_case_space_and_politeness_change_nothing(
    text: str, polite: str, case: object, space: str
) -> None:
    declarative = text.startswith(("The", "Make", "HSR"))
    wrapped = text if declarative and "Could" in polite else polite.format(text)
    said = case(wrapped).replace(" ", space) if callable(case) else wrapped
    assert read_goal(said, WORDS).stages == read_goal(text, WORDS).stages


@st.composite
def vocabularies(draw: st.DrawFn) -> Vocabulary:
    """Places, and objects of a few kinds, all with made-up names."""
    names = draw(st.permutations(NONSENSE))
    places = names[: draw(st.integers(2, 4))]
    kinds = names[4 : 4 + draw(st.integers(1, 4))]
    joint = draw(st.sampled_from(["_", "-", ""]))
    objects = [
        Object(object=f"{kind}{joint}{n}", kind=kind, label=f"the {kind} {n}", ordinal=n)
        for kind in kinds
        for n in range(1, draw(st.integers(1, 4)) + 1)
    ]
    return Vocabulary(
        {name: Place(place=name, label=f"The {name.title()}") for name in places},
        {thing.object: thing for thing in objects},
        {"hsr": manipulator(), "locobot": carrier()},
    )


@settings(max_examples=200, deadline=None)
@given(vocabularies(), st.data())
def test_what_is_meant_is_read(words: Vocabulary, data: st.DataObject) -> None:
    """Sentences made from conditions are read as those conditions."""
    things = data.draw(
        st.lists(st.sampled_from(sorted(words.objects)), min_size=1, max_size=4, unique=True)
    )
    clauses, expected = [], []
    for name in things:
        thing, place = words.objects[name], data.draw(st.sampled_from(sorted(words.places)))
        ordinal = ["first", "2nd", "third", "fourth"][thing.ordinal - 1]
        called = data.draw(
            st.sampled_from(
                [name, thing.label, f"the {ordinal} {thing.kind}", f"{thing.kind} #{thing.ordinal}"]
            )
        )
        clause, condition = data.draw(
            st.sampled_from(
                [
                    (f"bring {called} to the {place}", f"at({name}) = {place}"),
                    (f"put {called} in {place}", f"at({name}) = {place}"),
                    (f"{called} should be at the {place}", f"at({name}) = {place}"),
                    (f"find {called}", f"located({name})"),
                    (f"pick {called} up", f"held({name})"),
                    (f"give {called} to the locobot", f"at({name}) = locobot"),
                ]
            )
        )
        clauses.append(clause)
        expected.append(condition)
    joint, between = data.draw(
        st.sampled_from([(". ", "; "), (", then ", " > "), (" and then ", " > "), ("; ", "; ")])
    )
    assert shown(read_goal(joint.join(clauses), words)) == between.join(expected)
