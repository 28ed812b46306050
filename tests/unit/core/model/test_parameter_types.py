"""Types of parameters: what may stand where, for the checker and for grounding."""

from __future__ import annotations

from dataclasses import replace

import pytest
from msgspec.structs import replace as with_fields

from fleet.core.checker.plan_checker import CheckedPlan, InvalidPlan, check_plan
from fleet.core.model.parameter_types import BadType, narrowed, parse_type
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.world import WorldModel
from fleet.planners.base import PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.world import Object
from tests.support.household import fact, home, manipulator

THINGS = (
    Object(object="mug_1", kind="mug", label="mug", categories=("cup", "dish"), features=("open",)),
    Object(object="jar_1", kind="jar", label="jar", features=("contains", "openable")),
    Object(object="tv_1", kind="television", label="tv", movable=False),
)
DUST = {
    "dust": {
        "parameters": {"robot": "robot", "object": "movable & dish | jar"},
        "after": ["dusty(object) = false"],
    }
}


def house() -> WorldModel:
    robot = with_fields(manipulator(), skills=(*manipulator().skills, "dust"))
    skills = skills_from_data({"skills": DUST}, "here")
    world = home((robot,), facts=tuple(fact(t.object, "at", "kitchen") for t in THINGS))
    things = {thing.object: thing for thing in THINGS}
    return replace(world, skills={**world.skills, **skills}, objects=things)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("object", {"mug_1", "jar_1", "tv_1"}),
        ("movable", {"mug_1", "jar_1"}),
        ("cup", {"mug_1"}),
        ("television|mug", {"mug_1", "tv_1"}),
        ("movable & openable", {"jar_1"}),
        ("dish & openable", set()),
        ("place", {"kitchen", "hallway", "living_room"}),
        ("place | contains", {"kitchen", "hallway", "living_room", "jar_1"}),
        ("robot", {"hsr"}),
    ],
)
def test_a_type_has_the_names_that_fit(text: str, names: set[str]) -> None:
    assert set(house().of_type(text)) == names


@pytest.mark.parametrize("text", ["", "a &", "a | | b", "robot | object", "place & movable", "3"])
def test_what_is_no_type_is_refused(text: str) -> None:
    with pytest.raises(BadType, match=r".+"):
        parse_type(text)


def test_a_narrower_type_is_of_both() -> None:
    both = narrowed(parse_type("object | place"), parse_type("switchable | openable"))
    assert str(both) == "switchable | openable"
    assert narrowed(parse_type("place"), parse_type("openable")) is None


def dusting(thing: str) -> Plan:
    task = Task(task="t1", skill="dust", args={"robot": "?a1", "object": thing}, actor="a1")
    return Plan(plan="p", goals=(), conditions=(), tasks=(task,))


def test_the_checker_refuses_an_argument_of_another_type() -> None:
    checked = check_plan(dusting("tv_1"), house())
    assert isinstance(checked, InvalidPlan)
    assert [(v.code, v.task) for v in checked.violations] == [("wrong-type", "t1")]
    sentence = checked.violations[0].sentence
    assert "must be movable & dish | jar and is tv_1, which is not" in sentence
    assert "there are jar_1, mug_1" in sentence
    assert not check_plan(dusting("mug_1"), house()).violations


@pytest.mark.parametrize(("thing", "planned"), [("mug_1", True), ("jar_1", True), ("tv_1", False)])
def test_only_what_is_of_the_type_is_planned_with(thing: str, planned: bool) -> None:
    wanted = Condition(relation="dusty", subject=thing, value=False)
    goal = Goal(goal="g", text="dust it", conditions=(wanted,))
    made = SymbolicPlanner().plan(PlanningProblem("p", (goal,), house()))
    assert isinstance(made, CheckedPlan) is planned
