"""The suite of sentences: its files, and how answers are classed."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from benchmarks.language.entries import (
    KINDS,
    PARTS,
    Entry,
    GoalEntry,
    MeaningEntry,
    QuestionEntry,
    Sentence,
    load_suite,
    plain,
)
from benchmarks.language.meanings import Meaning, conditions, wanted
from benchmarks.language.reader import Answer, AskedBack, Read, Refused, answer, skills_of
from benchmarks.language.report import Result, rows_of, target_rows, time_rows, write_page
from benchmarks.language.verdict import Verdict, as_it_should_be, judge
from benchmarks.language.worlds import load_language_world, world_names
from keyexpr_schema.facts import AT, IN, ON, FactKey

SUITE = load_suite()
STATES = {"held", "located", "searched", "holding", "next_to", "near", "under", "owner"}
"""Relations that no skill file declares: derived ones, and those that are beyond the fleet."""


def test_there_are_enough_sentences_of_every_kind_and_a_third_is_held_out() -> None:
    assert len(SUITE) >= 600
    by_chance = [sentence for sentence in SUITE if "-o" not in sentence.entry.id]
    """Not those that were written by whoever mended the reader."""
    of_kind = Counter(sentence.kind for sentence in by_chance)
    assert all(of_kind[kind] >= 50 for kind in KINDS)
    for kind in KINDS:
        hidden = sum(s.part == "held-out" for s in by_chance if s.kind == kind)
        assert 0.2 <= hidden / of_kind[kind] <= 0.45
    assert {s.part for s in SUITE} == set(PARTS)
    assert {s.entry.world for s in SUITE} == set(world_names())


def test_no_id_and_no_sentence_comes_twice() -> None:
    """In one world, whatever the case and the punctuation."""
    assert len({s.entry.id for s in SUITE}) == len(SUITE)
    said = Counter((s.entry.world, plain(s.entry.say)) for s in SUITE)
    assert max(said.values()) == 1


@pytest.mark.parametrize("world", world_names())
def test_expectations_speak_of_what_exists(world: str) -> None:
    there = load_language_world(world)
    declared = {
        name: row.values
        for skill in skills_of(there).values()
        for name, row in skill.relations.items()
    }
    words = {value for row in declared.values() if isinstance(row, tuple) for value in row}
    known = {*there.names, *words, "nothing"}
    stated = {key.relation for key in there.facts}
    for sentence in SUITE:
        if sentence.entry.world != world:
            continue
        entry = sentence.entry
        for meaning in (*entry.meanings(), *entry.candidates()):
            assert meaning.names() <= known, entry.id
            relations = {row.relation.removeprefix("not ") for row in meaning.rows()}
            assert relations <= {AT, ON, IN, *STATES, *declared, *stated}, entry.id


@pytest.mark.parametrize("world", world_names())
def test_things_are_put_on_what_carries_them(world: str) -> None:
    """`on` and `in` want a thing with that feature, `at` a place, person, robot or such a thing."""
    there = load_language_world(world)
    features = {ON: "supports", IN: "contains"}
    for sentence in SUITE:
        if sentence.entry.world != world or sentence.entry.beyond:
            continue
        for meaning in sentence.entry.meanings():
            for row in (row for goal in meaning.goals for stage in goal.stages for row in stage):
                if row.relation not in features:
                    continue
                for value in row.values:
                    parts = [
                        thing
                        for thing in there.objects.values()
                        if value in (thing.object, thing.part_of)
                    ]
                    assert any(features[row.relation] in t.features for t in parts), sentence.entry


def test_worlds_say_where_things_are() -> None:
    house = load_language_world("house")
    assert house.facts[FactKey(AT, "green_mug")] == "coffee_table"
    assert house.carriers("apple_1") == ("big_bowl", "kitchen_table", "kitchen")
    flat = load_language_world("apartment")
    assert flat.carriers("spoon_1") == ("kitchen_unit_drawer_1", "kitchen_unit", "kitchen")


def entry(**fields: object) -> Entry:
    return Entry(**{"id": "one", "world": "house", "say": "Wash the mug", **fields})  # type: ignore[arg-type]


def goal(text: str) -> Meaning:
    return MeaningEntry(goal=text).meaning()


def nothing(text: str) -> Answer:
    return Refused(text)


WASH = "clean(red_mug)"
WHICH = {"asks": (MeaningEntry(goal=WASH), MeaningEntry(goal="clean(blue_mug)"))}


@pytest.mark.parametrize(
    ("fields", "given", "verdict"),
    [
        ({"goal": WASH}, Read(goal(WASH)), Verdict.RIGHT),
        ({"goal": WASH}, Read(goal("clean(blue_mug)")), Verdict.WRONG),
        ({"goal": WASH}, Read(goal("clean(red_mug|blue_mug)")), Verdict.WRONG),
        (
            {"goal": WASH, "also": (MeaningEntry(goal="held(sponge)"),)},
            Read(goal("held(sponge)")),
            Verdict.RIGHT,
        ),
        ({"goal": WASH, "priority": 1}, Read(goal(WASH)), Verdict.WRONG),
        ({"goal": WASH, "when": "is_on(tv)"}, Read(goal(WASH)), Verdict.WRONG),
        ({"goal": WASH}, Refused("'Wash the' is odd"), Verdict.REFUSED),
        ({"goal": WASH, "beyond": "soap"}, Refused("'Wash the' is odd"), Verdict.WELL_REFUSED),
        ({"goal": WASH}, Refused("'mug' is odd (did you mean 'rug'?)"), Verdict.MISLEADING),
        ({"goal": WASH}, AskedBack("which?", (goal(WASH),)), Verdict.ASKED),
        ({"goal": WASH}, AskedBack("which?", (goal("held(pan)"),)), Verdict.MISLEADING),
        ({"goal": WASH}, AskedBack("which?", names=frozenset({"red_mug"})), Verdict.ASKED),
        (WHICH, AskedBack("which?", (goal(WASH), goal("clean(blue_mug)"))), Verdict.ASKED),
        (WHICH, AskedBack("which?", (goal(WASH),)), Verdict.MISLEADING),
        (WHICH, AskedBack("?", names=frozenset({"red_mug", "blue_mug"})), Verdict.ASKED),
        (WHICH, AskedBack("?", names=frozenset({"red_mug"})), Verdict.MISLEADING),
        (WHICH, Read(goal(WASH)), Verdict.WRONG),
        (WHICH, Refused("'the mug' is odd"), Verdict.REFUSED),
        ({"refused": ("mug",)}, Refused("'the mug' is not known"), Verdict.WELL_REFUSED),
        ({"refused": ("mug",)}, Refused("it wants mug twice"), Verdict.WELL_REFUSED),
        ({"refused": ("cup|mug",)}, Refused("'the mug' is not known"), Verdict.WELL_REFUSED),
        ({"refused": ("soap", "mug")}, Refused("'the mug' is not known"), Verdict.MISLEADING),
        ({"refused": ("mug",)}, Refused("'odd'; known are mug, cup"), Verdict.MISLEADING),
        ({"refused": ("mug",)}, Refused("'please do wash the mug' is odd"), Verdict.MISLEADING),
        ({"refused": ("mug",)}, AskedBack("which?"), Verdict.MISLEADING),
        ({"refused": ("mug",)}, Read(goal(WASH)), Verdict.WRONG),
    ],
)
def test_answers_are_classed(fields: dict[str, object], given: Answer, verdict: Verdict) -> None:
    assert judge(entry(**fields), given, nothing) is verdict


def test_a_hint_that_leads_to_the_meaning_is_a_question_back() -> None:
    typo = entry(say="Wash the mgu", goal=WASH, typo=True)

    def again(text: str) -> Answer:
        return Read(goal(WASH)) if text == "Wash the mug" else Refused(text)

    verdict = judge(typo, Refused("'mgu' is not known (did you mean 'mug'?)"), again)
    assert verdict is Verdict.ASKED
    assert as_it_should_be(typo, verdict)
    away = judge(typo, Refused("'mgu' is not known (did you mean 'rug'?)"), again)
    assert away is Verdict.MISLEADING


@pytest.mark.parametrize(
    ("fields", "good"),
    [
        ({"goal": WASH}, {Verdict.RIGHT}),
        ({"goal": WASH, "beyond": "soap"}, {Verdict.RIGHT, Verdict.WELL_REFUSED}),
        ({"refused": ("mug",)}, {Verdict.WELL_REFUSED}),
        (WHICH, {Verdict.ASKED}),
    ],
)
def test_what_is_as_it_should_be(fields: dict[str, object], good: set[Verdict]) -> None:
    assert {v for v in Verdict if as_it_should_be(entry(**fields), v)} == good


def test_a_meaning_is_the_same_however_it_is_written() -> None:
    assert wanted("at(a|b) = x|y") == wanted(" at(b | a) = y | x ")
    assert wanted("clean(a)") == wanted("clean(a) = true")
    assert wanted("in(a) != x").relation == "not in"
    assert conditions("clean(a); clean(b)") == conditions("clean(b);clean(a)")
    each = GoalEntry(never="at(a) = x; at(b) = x").wanted_meaning()
    assert GoalEntry(never="at(a|b) = x").wanted_meaning() == each
    first = GoalEntry(goal="clean(b)", before=(("clean(a)", "clean(b)"),))
    assert first.wanted_meaning() == GoalEntry(goal="clean(a) > clean(b)").wanted_meaning()
    assert goal("clean(a); clean(b)") != goal("clean(a) > clean(b)")
    assert goal("clean(a|b)") != goal("clean(a); clean(b)")
    asked = QuestionEntry(of="which", subjects="a|b", holds="clean(?)")
    assert MeaningEntry(question=asked).meaning() != Meaning()


def test_sentences_are_read_in_their_world_and_counted() -> None:
    some = [
        Sentence(part="dev", kind="simple", entry=entry(say=say, goal=want))
        for say, want in (
            ("Put the cola on the dining table", "on(cola) = dining_table"),
            ("Put the cola on the hall table", "on(cola) = dining_table"),
        )
    ]
    results = []
    for sentence in some:
        found = answer(sentence.entry.say, "house")
        verdict = judge(sentence.entry, found, nothing)
        results.append(Result(sentence, found, verdict, took_s=0.002))
    assert [r.verdict for r in results] == [Verdict.RIGHT, Verdict.WRONG]
    simple, *totals = rows_of(results)
    assert simple == ("simple", "2", "1", "0", "0", "0", "0", "1", "50 %")
    assert [row[1:] for row in totals] == [simple[1:], simple[1:]]
    wrong, plain_ones, *_ = target_rows(results)
    assert (wrong[-1], plain_ones[-1]) == ("1", "50 %")
    assert time_rows(results) == [("6 to 10", "2", "2.0 ms", "2.0 ms")]


def test_the_page_names_what_was_taken_for_something_else(tmp_path: Path) -> None:
    page = tmp_path / "language.md"
    wrong = Read(goal("clean(blue_mug)"))
    results = [
        Result(
            Sentence(part=part, kind="simple", entry=entry(say=say, goal=WASH)),
            wrong,
            Verdict.WRONG,
            took_s=0.001,
        )
        for part, say in (("dev", "Wash the open mug"), ("held-out", "Wash the hidden mug"))
    ]
    write_page(page, results)
    text = page.read_text(encoding="utf-8")
    assert "Wash the open mug" in text
    assert "clean(blue_mug) = true" in text
    assert "hidden mug" not in text
