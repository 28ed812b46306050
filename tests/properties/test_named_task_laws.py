"""Laws of tasks that goals call by name: what comes of them is about what there is, and about
nothing else."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.language.reader import vocabulary_of
from benchmarks.language.worlds import NOW
from fleet.errors import NotUnderstood
from fleet.language import Ambiguity, Reading, Vocabulary, read
from fleet.language.methods.patterns import rows_of
from tests.support.reached import Reached, reaches

HOUSE = vocabulary_of("house")
THINGS = sorted(HOUSE.objects)
WORDS = {word.value for word in HOUSE.state_words}
PEOPLE = [name for name in THINGS if HOUSE.is_person(name)]
NAMES = {
    "number": ("one", "two", "3", "nine"),
    "place": ("the kitchen", "the bedroom", "the living room", "the garage"),
    "person": ("Anna", "Lily", "the guest", "me"),
}
ROWS = [row for task in HOUSE.tasks for phrase in task.says for row in rows_of(phrase)]


AWAY = st.binary(min_size=len(THINGS) // 8 + 1, max_size=len(THINGS) // 8 + 1)
"""A bit for each thing: whether it is gone."""


@st.composite
def calls(draw: st.DrawFn) -> str:
    row = draw(st.sampled_from(ROWS))
    return " ".join(p if isinstance(p, str) else draw(st.sampled_from(NAMES[p.type])) for p in row)


def without(gone: set[str]) -> Vocabulary:
    """The house where these things are not, and nobody ever spoke of them."""
    there = {name: thing for name, thing in HOUSE.objects.items() if name not in gone}
    return replace(
        HOUSE,
        objects=there,
        whereabouts={name: at for name, at in HOUSE.whereabouts.items() if name not in gone},
        rests={a: b for a, b in HOUSE.rests.items() if a not in gone and b not in gone},
        carriers={
            name: tuple(each for each in around if each not in gone)
            for name, around in HOUSE.carriers.items()
            if name not in gone
        },
        believed={
            key: value
            for key, value in HOUSE.believed.items()
            if key.subject not in gone and value not in gone
        },
    )


@reaches("meant", "refused", "a later method", least={"meant": 5, "refused": 3})
@settings(max_examples=40, deadline=None)
@given(text=calls(), away=AWAY)
def test_a_method_wants_nothing_of_what_is_not_there(
    reached: Reached, text: str, away: bytes
) -> None:
    gone = {name for i, name in enumerate(THINGS) if away[i // 8] >> i % 8 & 1} - set(PEOPLE)
    words = without(gone)
    try:
        found = read(text, words, NOW)
    except NotUnderstood as refused:
        reached["refused"] += 1
        assert "\n" not in str(refused)
        return
    readings = [r for _, r in found.candidates] if isinstance(found, Ambiguity) else [found]
    there = {*words.places, *words.objects, *words.robots}
    for reading in readings:
        assert isinstance(reading, Reading)
        for goal in reading.goals:
            for condition in (*(c for s in goal.stages for c in s), *goal.always, *goal.never):
                assert set(condition.subjects) <= there, text
                value = condition.value
                assert not isinstance(value, str) or value in there or value in WORDS, text
        reached["meant"] += bool(reading.methods)
        reached["a later method"] += any(use.passed_over for use in reading.methods)
