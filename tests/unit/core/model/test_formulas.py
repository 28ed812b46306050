"""Formulas of skills: as text, evaluated, written out, and what can be said of sets of values."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import pytest

from fleet.core.model.formulas.abstraction import domains, outcomes
from fleet.core.model.formulas.evaluation import evaluate, expanded
from fleet.core.model.formulas.nodes import FALSE, TRUE, Formula, grounded
from fleet.core.model.formulas.text import (
    BadFormula,
    effect_text,
    formula_text,
    parse_effect,
    parse_formula,
)
from fleet.core.model.preconditions import made_true
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.skills import SkillModel
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import FactKey, Value
from keyexpr_schema.payloads.world import Object
from tests.support.household import home

THINGS = (
    Object(object="box", kind="box", label="", features=("contains",), properties={"size_l": 5}),
    Object(object="fridge", kind="fridge", label="", movable=False, features=("openable",)),
    Object(object="cup", kind="cup", label="", properties={"size_l": 0.5}),
    Object(object="jug", kind="jug", label="", properties={"size_l": 2, "lid": "red"}),
)
FACTS: dict[FactKey, Value] = {
    FactKey("at", "fridge"): "kitchen",
    FactKey("at", "box"): "fridge",
    FactKey("at", "cup"): "box",
    FactKey("is_open", "fridge"): False,
    FactKey("level", "jug"): 2,
}
NAMES = {"a": "cup", "b": "box", "c": "fridge", "j": "jug"}


def house() -> WorldModel:
    return replace(home(), objects={thing.object: thing for thing in THINGS}, facts=FACTS)


def parsed(text: str) -> Formula:
    return grounded(parse_formula(text, NAMES), NAMES)


CASES = [
    ("at(a) = b", True),
    ("at(a) = kitchen", True),
    ("not at(a) = c", False),
    ("at(a) != c", False),
    ("reachable(a) = true", False),
    ("is_open(c) = true or in(a) = b", True),
    ("is_open(c) = false and in(a) = c", False),
    ("not (is_open(c) = false and in(a) = c)", True),
    ("is_open(c) = true or in(a) = b and is_open(c) = true", False),
    ("level(j) >= 1", True),
    ("level(j) >= 1 + 2 - 1", True),
    ("level(j) < -1", False),
    ("level(a) < 3", False),
    ("not level(a) < 3", True),
    ("size_l(j) + size_l(a) <= size_l(b)", True),
    ("lid(j) = red", False),  # a property is no state: only comparisons read it
    ("size_l(a) < size_l(j)", True),
    ("movable(c)", False),
    ("openable(c) and not movable(c)", True),
    ("count(x: object, in(x) = b) < 1", False),
    ("count(x: movable & cup, in(x) = b) = 1", True),
    ("sum(x: movable, at(x) = c, size_l(x)) <= 5", False),
    ("all(x: openable, is_open(x) = false)", True),
    ("all(x: movable, at(x) = kitchen)", False),
    ("any(x: jug | cup, at(x) = b)", True),
    ("any(x: object, any(y: contains, in(x) = y and x != a))", False),
    ("a != b", True),
]


@pytest.mark.parametrize(("text", "expected"), CASES)
def test_a_formula_holds_as_it_says(text: str, expected: bool) -> None:
    world, formula = house(), parsed(text)
    assert evaluate(formula, FACTS.get, world) is expected
    assert evaluate(parse_formula(text, NAMES), FACTS.get, world, NAMES) is expected
    written_out = expanded(formula, world)
    assert evaluate(written_out, FACTS.get, world) is expected
    assert expanded(written_out, world) == written_out
    # With one value for each variable there is nothing left open.
    assert outcomes(written_out, lambda v: (FACTS.get(v),), world) == (expected, not expected)


@pytest.mark.parametrize(("text", "_"), CASES)
def test_a_formula_is_written_as_it_is_read(text: str, _: bool) -> None:
    formula = parse_formula(text, NAMES)
    assert parse_formula(formula_text(formula), NAMES) == formula
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(formula), type=Formula) == formula


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("at(a) =", "at the end there should be a value"),
        ("at(d) = b", "'d', which is not a parameter; those are a, b, c, j"),
        ("not", "at the end"),
        ("(at(a) = b", "at the end there should be ')'"),
        ("at(a) = b at(a) = c", "nothing more, or `and`, `or`"),
        ("count(a: object, in(a) = b) < 2", "'a' has a meaning already"),
        ("count(x: object in(x) = b) < 2", "','"),
        ("all(x: a & , at(x) = b)", "a type"),
        ("level(j) ?? 2", "cannot be read"),
        ("all(x: movable, at(x) = b) and at(x) = c", "'x', which is not a parameter"),
        ("level(j) + 2", "'<'"),
        ("any(x: place & red, at(a) = x)", "narrows robot or place"),
    ],
)
def test_what_is_no_formula_is_refused_in_one_sentence(text: str, what: str) -> None:
    with pytest.raises(BadFormula) as wrong:
        parse_formula(text, NAMES)
    assert what in str(wrong.value)
    assert text in str(wrong.value)


@pytest.mark.parametrize(
    "text",
    [
        "at(a) = b",
        "level(j) += 1",
        "level(j) += 0 - size_l(a)",
        "if level(j) > 1: wet(a) = true",
        "all(x: movable, if in(x) = b: at(x) = c)",
    ],
)
def test_an_effect_is_written_as_it_is_read(text: str) -> None:
    effect = parse_effect(text, NAMES)
    assert parse_effect(effect_text(effect), NAMES) == effect


@pytest.mark.parametrize("text", ["if level(j) > 1", "level(j) < 1", "if level(j) > 1 at(a) = b"])
def test_what_is_no_effect_is_refused(text: str) -> None:
    with pytest.raises(BadFormula):
        parse_effect(text, NAMES)


def skill(**fields: list[str]) -> SkillModel:
    model = {"parameters": {"robot": "robot", "a": "cup", "j": "jug", "b": "contains"}, **fields}
    return skills_from_data({"skills": {"do": model}}, "here")["do"]


def test_effects_are_judged_by_what_held_before() -> None:
    action = skill(
        after=[
            "at(a) = b",
            "level(j) -= size_l(a)",
            "if level(j) = 2: was_full(j) = true",
            "all(x: movable, if at(x) = b: moved(x) = true)",
        ]
    ).ground({"robot": "hsr", "a": "cup", "j": "jug", "b": "box"})
    facts = {**FACTS, FactKey("at", "cup"): "kitchen"}
    assert dict(made_true(action, facts, house())) == {
        FactKey("at", "cup"): "box",
        FactKey("level", "jug"): 1.5,
        FactKey("was_full", "jug"): True,
    }


def test_what_is_added_to_the_unknown_is_unknown() -> None:
    action = skill(after=["level(j) += 1"]).ground(
        {"robot": "hsr", "a": "cup", "j": "jug", "b": "box"}
    )
    facts = {key: value for key, value in FACTS.items() if key.relation != "level"}
    assert dict(made_true(action, facts, house())) == {FactKey("level", "jug"): None}


def test_conjuncts_about_one_variable_are_domains_for_the_search() -> None:
    values: dict[FactKey, set[Value]] = {
        FactKey("at", "cup"): {"box", "fridge", "hallway", None},
        FactKey("at", "box"): {"fridge"},
        FactKey("at", "fridge"): {"kitchen"},
        FactKey("is_open", "fridge"): {True, False},
        FactKey("level", "jug"): {0, 1, 2},
    }
    texts = (
        "at(a) = kitchen and level(j) >= 1",
        "level(j) < 2 and not movable(c)",
        "reachable(a) = true",
    )
    simple, opaque = domains(
        (expanded(parsed(text), house()) for text in texts), values.get, house()
    )
    assert simple == {
        FactKey("at", "cup"): frozenset({"box", "fridge"}),
        FactKey("level", "jug"): frozenset({1}),
    }
    assert opaque == (parsed("reachable(a) = true"),)
    assert domains([TRUE, FALSE], values.get, house()) == ({}, (FALSE,))


def test_outcomes_are_those_of_all_values_together() -> None:
    values: dict[FactKey, set[Value]] = {
        **{key: {value} for key, value in FACTS.items()},
        FactKey("level", "jug"): {1, 2},
        FactKey("at", "cup"): {"box", "hallway"},
    }
    for text, expected in (
        ("level(j) > 0", (True, False)),
        ("level(j) > 1", (True, True)),
        ("level(j) > 2", (False, True)),
        ("count(x: object, in(x) = b) < 2", (True, False)),
        ("count(x: object, in(x) = b) < 1", (True, True)),
        ("at(a) = b or level(j) > 0", (True, False)),
    ):
        formula = expanded(parsed(text), house())
        found = outcomes(formula, lambda v: values.get(v, {None}), house())
        assert found == expected, text
