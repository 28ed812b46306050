"""Skill files: relations that are declared, formulas, and sentences on what is wrong."""

from __future__ import annotations

import re
from typing import Any

import msgspec
import pytest

from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.skills import SkillModel
from fleet.errors import BadSkillFile
from keyexpr_schema.facts import FactKey, Literal

RELATIONS = {
    "is_on": {"of": "switchable", "values": "bool"},
    "temperature": {"of": "movable", "values": ["hot", "cold", "room"]},
    "level": {"of": "jug | bottle", "values": "number"},
    "beside": {"of": "object", "values": "person"},
}
PARAMETERS = {"robot": "robot", "thing": "object", "place": "place", "who": "person"}


def read(**fields: Any) -> SkillModel:
    model = {"parameters": PARAMETERS, **fields}
    return skills_from_data({"relations": RELATIONS, "skills": {"do": model}}, "my.yaml")["do"]


def test_parameters_are_also_of_the_types_of_what_is_said_of_them() -> None:
    skill = read(before=["temperature(thing) = cold"], after=["is_on(thing) = true"])
    assert skill.parameters["thing"] == "movable & switchable"
    assert skill.types["thing"].bases == ("object",)
    assert sorted(skill.relations) == ["is_on", "temperature"]


def test_what_only_may_hold_narrows_nothing() -> None:
    skill = read(before=["not switchable(thing) or is_on(thing) = false"])
    assert skill.parameters["thing"] == "object"
    assert skill.before == ()
    assert len(skill.conditions) == 1


def test_what_is_plain_stays_plain() -> None:
    skill = read(
        before=["at(thing) = place", "at robot place", "beside(thing) = who"],
        after=[
            "in(thing) = who",
            "if is_on(thing) = true: is_on(thing) = false",
            "level(thing) += 1",
        ],
    )
    assert skill.conditions == ()
    assert skill.before[1] == Literal(FactKey("at", "robot"), "place")
    # Where something is, one variable says.
    assert skill.after == (Literal(FactKey("at", "thing"), "who"),)
    assert len(skill.conditional) == 2


def test_models_with_formulas_go_through_a_journal() -> None:
    skill = read(
        before=["count(x: movable, at(x) = thing) < 3", "level(thing) >= 1"],
        after=["all(x: movable, if in(x) = thing: temperature(x) = hot)", "level(thing) -= 1"],
    )
    data = msgspec.msgpack.encode(skill)
    assert msgspec.msgpack.decode(data, type=SkillModel) == skill


def test_models_of_before_have_no_formulas() -> None:
    known = msgspec.to_builtins(read(after=["at(robot) = place"]))
    old = {k: v for k, v in known.items() if k not in ("conditions", "conditional", "relations")}
    assert msgspec.convert(old, SkillModel).conditions == ()


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        (
            {"after": ["temperature(thing) = warm"]},
            "'temperature(thing) = warm': the value of temperature is one of hot, cold, room, "
            "not warm",
        ),
        ({"before": ["is_on(thing) = 3"]}, "the value of is_on is bool, not 3"),
        ({"before": ["not is_on(thing) = maybe"]}, "the value of is_on is bool, not maybe"),
        ({"after": ["level(thing) = full"]}, "the value of level is number, not full"),
        ({"after": ["beside(thing) = place"]}, "the value of beside is person, not place"),
        ({"after": ["temperature(thing) += 1"]}, "temperature is declared as no number"),
        (
            {"after": ["is_on(place) = true"]},
            "is_on is said of switchable, and `place` is of type place",
        ),
        ({"before": ["at(thing) ="]}, "at the end there should be a value"),
        ({"before": ["at(nobody) = place"]}, "'nobody', which is not a parameter"),
        ({"before": ["at(nobody) = place or at(thing) = place"]}, "'nobody', which is not a"),
        ({"before": ["space(place)"]}, "space(place) must name a parameter of type robot, or of a"),
        ({"after": ["all(x: movable, if at(x) = thing)"]}, "there should be ':'"),
        ({"parameters": {"robot": "robot", "thing": "place & movable"}}, "narrows robot or place"),
        ({"parameters": {"robot": "robot", "thing": 3}}, "must map names to types"),
        ({"needs": {"robot": ["grip >= mass(place)"]}}, "must look like `drive`"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(fields: dict[str, Any], sentence: str) -> None:
    with pytest.raises(BadSkillFile) as wrong:
        read(**fields)
    assert str(wrong.value).startswith("my.yaml: skill do: ")
    assert sentence in str(wrong.value)
    assert "\n" not in str(wrong.value)


@pytest.mark.parametrize(
    "declared",
    [
        [],
        {"is_on": "bool"},
        {"is_on": {"of": "switchable"}},
        {"is_on": {"of": "a b", "values": "bool"}},
        {"is_on": {"of": "switchable", "values": []}},
        {"is_on": {"of": "switchable", "values": 3}},
    ],
)
def test_a_declaration_that_is_none_is_refused(declared: Any) -> None:
    with pytest.raises(BadSkillFile, match=r"my\.yaml: .*relation"):
        skills_from_data({"relations": declared, "skills": {}}, "my.yaml")


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"after": ["reachable(x) = true"]}, "is read off where things are, and no effect"),
        ({"after": ["in(x) = x"]}, "'in(x) = x' would put x into itself"),
        (
            {"after": ["done(x) = true", "done(x) = false"]},
            "'done(x) = false' and done(x) = true cannot both hold",
        ),
        ({"duration_s": float("nan")}, "`duration_s` must be a number of seconds, not nan"),
        ({"travel_to": ["x"]}, "`travel_to` must name a parameter of type place"),
        ({"duration_s": float("inf")}, "`duration_s` must be a number of seconds, not inf"),
    ],
)
def test_effects_and_durations_that_cannot_be_are_refused(
    fields: dict[str, Any], sentence: str
) -> None:
    skill = {"parameters": {"robot": "robot", "x": "cup"}, **fields}
    with pytest.raises(BadSkillFile, match=re.escape(sentence)):
        skills_from_data({"skills": {"s": skill}}, "my.yaml")
