"""Two goals of which anything differs are said in other words: that is what a person confirms."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import combinations
from typing import Any

import pytest
from msgspec.structs import replace as changed

from fleet.language.phrasing import Phrasing
from fleet.language.reading import Reading, WantedGoal
from keyexpr_schema.facts import HELD, HOLDING, LOCATED, NOTHING, SEARCHED
from keyexpr_schema.payloads.goals import Condition
from tests.support.household import at
from tests.support.language_flat_said import SPOKEN

ONE, OTHER = at("cup_1", "kitchen"), at("cup_2", "hallway")
PLAIN = WantedGoal(((ONE,),))
_ROWS = ((), (ONE,), (OTHER,), (ONE, OTHER), (changed(ONE, negated=True),))
_TIMES = (None, 0.0, 600.0, 601.0, 36_061.0, 36_062.0)
_SAMPLES: dict[str, tuple[Any, ...]] = {
    "stages": (((ONE,),), ((OTHER,),), ((ONE, OTHER),), ((ONE,), (OTHER,)), ((OTHER,), (ONE,))),
    **dict.fromkeys(("always", "never", "when", "only_if", "whenever"), _ROWS),
    "priority": (0, 1, -1, 2),
    "not_before_s": _TIMES,
    "due_s": _TIMES,
    "every": (None, "0 8 * * *", "0 9 * * *", "0 8 * * 1-5", "PT2H", "PT2M"),
    "by": ((), ("hsr",), ("locobot",), ("hsr", "locobot")),
    "otherwise": (False, True),
}


@pytest.mark.parametrize("name", [field.name for field in fields(WantedGoal)])
def test_whatever_differs_between_two_goals_is_said(name: str) -> None:
    goals = [replace(PLAIN, **{name: value}) for value in _SAMPLES[name]]
    phrasing = Phrasing(SPOKEN)
    for one, other in combinations(goals, 2):
        assert Reading("", (one,)).understood_as != Reading("", (other,)).understood_as
        assert phrasing.goal(one) != phrasing.goal(other)


def test_no_two_data_of_a_goal_are_said_alike() -> None:
    goals = [
        replace(PLAIN, **{name: value})
        for name, samples in _SAMPLES.items()
        for value in samples
        if value != getattr(PLAIN, name)
    ]
    assert len({Reading("", (goal,)).understood_as for goal in goals}) == len(goals)
    assert len({Phrasing(SPOKEN).goal(goal) for goal in goals}) == len(goals)


@pytest.mark.parametrize(
    "row",
    [
        at("cup_1", "kitchen"),
        Condition(relation="at", subject="cup_1", any_of=("cup_1", "cup_2"), value="kitchen"),
        Condition(relation=LOCATED, subject="cup_1", value=True),
        Condition(relation=HELD, subject="cup_1", value=True),
        Condition(relation=SEARCHED, subject="kitchen", value=True),
        Condition(relation=HOLDING, subject="hsr", value=NOTHING),
        Condition(relation="is_open", subject="fridge", value=True),
        Condition(relation="polished", subject="fridge", value=True),
        Condition(relation="temperature", subject="cup_1", value="hot"),
    ],
    ids=str,
)
def test_a_condition_that_is_negated_is_said_so(row: Condition) -> None:
    negated = changed(row, negated=True)
    said = Phrasing(SPOKEN).condition(negated)
    assert said != Phrasing(SPOKEN).condition(row)
    assert any(word in said.split() for word in ("not", "none", "no", "nobody"))
    assert str(negated) != str(row)
