"""Tasks that goals call by name: where they are called, which method is taken, what it means."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.language.worlds import NOW
from fleet.errors import NotUnderstood
from fleet.language import Ambiguity, read, read_goal, statement_facts
from fleet.language.meanings.expansion import CannotBeDone
from fleet.service.task_files import load_all_tasks
from keyexpr_schema.payloads.world import Object
from tests.support.named_tasks import reading, wanted, words_with

HOUSE = words_with(
    "house",
    {
        "night": {
            "says": ["get ready for the night", "good night"],
            "in_order": [
                ["switch off the floor lamp", "switch off the TV"],
                "close the living room window",
            ],
        },
        "table": {
            "says": "set|lay the table [for {n: number} [people]]",
            "defaults": {"n": 1},
            "methods": [
                {"needs": "{n} fork", "do": "put {n} forks on the dining table"},
                {"do": "put {n} plates on the dining table"},
            ],
        },
        "drink": {"says": "offer {who: person} a drink", "do": "bring {who} the cola"},
        "pots": {"says": "see to {pot: pot | pan}", "do": "put {pot} in the sink"},
        "air": {"says": "air {place: place}", "do": "open the windows in {place}"},
        "feast": {"says": "get ready for the feast", "in_order": ["set the table", "good night"]},
        "cups": {"says": "see to the cups", "do": "put the mug on the desk"},
        "endless": {"says": "go round", "do": "go round in circles"},
        "circles": {"says": "go round in circles", "do": "go round"},
        "closed": {"says": "mind the fridge", "do": "find the cola and keep the fridge closed"},
        "late": {"says": "do it late", "do": "switch on the floor lamp in ten minutes"},
        "asks": {"says": "do ask", "do": "where is the cola?"},
        "facts": {"says": "do tell", "do": "the cola is in the fridge"},
        "nowhere": {"says": "do nothing", "do": "bring the unicorn to the kitchen"},
    },
)
MACHINE = Object(object="m", kind="coffee_machine", label="coffee machine", movable=False)
FORK = "on(fork_1) = dining_table"
PLATES = "; ".join(f"on(plate_{number}) = dining_table" for number in (1, 2, 3))
NIGHT = "is_on(floor_lamp) = False; is_on(tv) = False > is_open(living_room_window) = False"


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("Good night!", NIGHT),
        ("could you please get ready for the night", NIGHT),
        ("Set the table.", FORK),
        ("lay table", FORK),
        ("set the table for one", FORK),
        ("Set the table for three people", PLATES),
        ("offer Lily a drink", "at(cola) = lily"),
        ("offer me a drink", "at(cola) = anna"),
        ("offer the guest a drink", "at(cola) = guest"),
        ("see to the frying pan", "in(pan) = sink"),
        ("air the living room", "is_open(living_room_window)"),
        ("Open the fridge, then good night", f"is_open(fridge) > {NIGHT}"),
        ("set the table, and open the fridge", f"{FORK}; is_open(fridge)"),
        ("good night and set the table", f"{NIGHT}; {FORK}"),
        ("Set the table. Then air the bedroom.", f"{FORK} > is_open(bedroom_window)"),
        ("after setting the table, open the fridge", f"{FORK} > is_open(fridge)"),
        ("get ready for the feast", f"{FORK} > {NIGHT}"),
    ],
)
def test_a_clause_that_is_a_tasks_phrase_means_what_its_method_says(
    text: str, meaning: str
) -> None:
    assert wanted(text, HOUSE) == meaning


def test_times_conditions_and_doers_are_those_of_the_sentence() -> None:
    (goal,) = reading("Rosie, set the table at 5 pm", HOUSE).goals
    assert goal.by == ("rosie",)
    assert goal.not_before_s == pytest.approx(7.5 * 3600)
    (told,) = reading("rosie should set the table", HOUSE).goals
    assert told.by == ("rosie",)
    (each,) = reading("every morning air the bedroom", HOUSE).goals
    assert each.every == "0 8 * * *"
    (goal,) = reading("If the front door is open, good night", HOUSE).goals
    conditions = {str(c) for row in (goal.when, getattr(goal, "only_if", ())) for c in row}
    assert conditions == {"is_open(front_door) = true"}


def test_what_shall_stay_is_kept() -> None:
    (goal,) = reading("mind the fridge", HOUSE).goals
    assert [str(c) for c in goal.always] == ["is_open(fridge) = false"]


@pytest.mark.parametrize(
    "text",
    [
        "don't set the table",
        "set the table and chairs",
        "set the kitchen table for two",
        "offer the fridge a drink",
        "see to the fork",
        "never air the bedroom",
        "has somebody set the table?",
        "rosie likes to set the table",
        "good night ladies",
    ],
)
def test_with_anything_else_beside_its_phrase_a_task_is_not_called(text: str) -> None:
    try:
        found = read(text, HOUSE, NOW)
    except NotUnderstood:
        return
    assert not isinstance(found, Ambiguity)
    assert found.methods == ()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("set the table for two in the kitchen", "'in the kitchen' is not understood after"),
        ("set the table and the chairs", "'and the chairs' is not understood after"),
        ("set the table carefully", "'carefully' is not understood after 'set the table'"),
    ],
)
def test_what_stands_beside_a_tasks_phrase_is_named(text: str, words: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read(text, HOUSE, NOW)
    assert words in str(refused.value)
    assert str(refused.value).endswith("which is a task")


def test_no_task_is_called_by_a_statement() -> None:
    with pytest.raises(NotUnderstood):
        statement_facts("good night", HOUSE)


def test_the_first_method_is_taken_for_which_all_is_there_and_why_is_kept() -> None:
    (one,) = reading("set the table", HOUSE).methods
    assert (one.task, one.number, one.passed_over) == ("table", 1, ())
    (other,) = reading("set the table for two", HOUSE).methods
    assert other.number == 2
    assert other.said == "set the table for two"
    assert other.text == "put 2 plates on the dining table."
    why = "it takes 2 forks, and there is only 1"
    assert other.passed_over == (("put 2 forks on the dining table.", why),)


def test_tasks_in_tasks_are_told_with_the_outer_one_first() -> None:
    assert [use.task for use in reading("get ready for the feast", HOUSE).methods] == [
        "feast",
        "table",
        "night",
    ]


def test_where_no_method_can_be_taken_all_reasons_are_said() -> None:
    with pytest.raises(CannotBeDone) as refused:
        read("set the table for nine", HOUSE, NOW)
    said = str(refused.value)
    assert said.startswith("'set the table for nine' cannot be done here: it takes 9 forks")
    assert "'9 plates': there are only 3" in said
    assert [text for text, _ in refused.value.passed_over] == [
        "put 9 forks on the dining table.",
        "put 9 plates on the dining table.",
    ]


def test_what_a_method_leaves_open_is_asked() -> None:
    found = read("see to the cups", HOUSE, NOW)
    assert isinstance(found, Ambiguity)
    assert {frozenset(c.subject for c in r.stages[0]) for _, r in found.candidates} == {
        frozenset({mug}) for mug in ("red_mug", "blue_mug", "green_mug")
    }


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("go round", "'go round' is a part of itself: endless → circles → endless"),
        ("do it late", "says when"),
        ("do ask", "says more than what is to be done"),
        ("do tell", "says more than what is to be done"),
        ("do nothing", "'do nothing' cannot be done here: 'the unicorn'"),
        ("air the garage", "'air the garage' cannot be done here: "),
        ("air the ballroom", "'air the ballroom' cannot be done here: "),
        ("offer Zorg a drink", "cannot be done here: 'Zorg' is not understood"),
    ],
)
def test_what_a_method_must_not_say_is_refused_with_the_tasks_phrase(text: str, words: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read(text, HOUSE, NOW)
    assert words in str(refused.value)


def test_tasks_are_not_named_by_each_other_without_end() -> None:
    deep = {f"t{n}": {"says": f"step {n}", "do": f"step {n + 1}"} for n in range(1, 10)}
    with pytest.raises(NotUnderstood, match="too deep: t1 → t2 → t3 → t4 → t5 → t6"):
        read("step 1", words_with("house", deep), NOW)


def test_programs_for_robots_can_be_told_by_a_tasks_name() -> None:
    assert read_goal("set the table", HOUSE).stages == reading("set the table", HOUSE).stages


def test_what_nobody_knows_comes_with_the_tasks_that_are_like_it() -> None:
    words = words_with("house", {})
    shipped = load_all_tasks()
    with pytest.raises(NotUnderstood) as alone:
        read("mow the lawn", words, NOW)
    assert "tasks known" not in str(alone.value)
    words = words_with(
        "house", {t.name: {"says": list(t.says[:1]), "do": "find the cola"} for t in shipped
                  if "{" not in t.says[0]},
    )  # fmt: skip
    with pytest.raises(NotUnderstood) as refused:
        read("make pancakes", words, NOW)
    said = str(refused.value)
    assert said.startswith("nothing is known of 'make pancakes'; tasks known are 'make ")
    assert said.count("', '") == 4
    assert "`robotctl planner --tasks FILE`" in said


@pytest.mark.parametrize("text", ["wash the zorgle", "bring the zorgle to the kitchen"])
def test_an_unknown_thing_is_no_unknown_task(text: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read(text, HOUSE, NOW)
    assert "'the zorgle' is not a known object" in str(refused.value)


@pytest.mark.parametrize("text", ["switch on the zorgles", "turn the zorgles on"])
def test_a_skill_asked_of_an_unknown_thing_is_no_unknown_task(text: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read(text, HOUSE, NOW)
    assert str(refused.value).startswith("'the zorgles' is not a known object")


@pytest.mark.parametrize(
    "text",
    ["Stop!", "please stop all robots at once", "halt", "Stop everything now"],
)
def test_who_wants_all_to_stop_is_told_how(text: str) -> None:
    with pytest.raises(NotUnderstood, match="`robotctl stop --all` brings all robots to rest"):
        read(text, HOUSE, NOW)
    assert wanted("stop the TV", HOUSE) == "is_on(tv) = False"


def test_what_a_task_lacks_is_said_in_plain_words() -> None:
    needs = ["coffee_machine & supports", "3 movable & dish", "{n} cup | glass", "2 knife"]
    words = words_with(
        "office",
        {
            "brew": {
                "says": "brew {n: number}",
                "methods": [{"needs": each, "do": "go to {n}"} for each in needs],
            }
        },
    )
    with pytest.raises(CannotBeDone) as refused:
        read("brew 90", replace(words, objects={"m": MACHINE}), NOW)
    assert [why for _, why in refused.value.passed_over] == [
        "there is no coffee machine to put things on",
        "it takes 3 movable dishes, and there are none",
        "it takes 90 cups or glasses, and there are none",
        "it takes 2 knives, and there are none",
    ]
