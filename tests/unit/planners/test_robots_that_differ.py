"""Robots of one kind of which the facts say different things: who can do what is known before a
robot is chosen."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fleet.allocators.base import Allocated
from fleet.core.checker.plan_checker import CheckedPlan, check_allocation, check_plan
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.world import WorldModel
from fleet.planners.base import PlanningProblem
from fleet.service.composition import compose
from keyexpr_schema.facts import FactKey, Value
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan, Task
from tests.support.household import PLACES, SKILLS, cup, manipulator

OWN = skills_from_data(
    {
        "skills": {
            "polish": {
                "parameters": {"robot": "robot", "place": "place"},
                "before": ["at(robot) = place", "battery(robot) >= 20"],
                "after": ["shiny(place) = true"],
            },
            "charge": {
                "parameters": {"robot": "robot"},
                "after": ["if battery(robot) < 20: charged(robot) = true"],
            },
            "lift": {
                "parameters": {"robot": "robot", "place": "place"},
                "before": ["at(robot) = place", "charged(robot) = true"],
                "after": ["lifted(place) = true"],
            },
        }
    },
    "here",
)
PARTS = compose()
NAMES = ("r1", "r2")


def world(battery: dict[str, int], **more: Value) -> WorldModel:
    robots = tuple(replace(manipulator(n), skills=(*manipulator().skills, *OWN)) for n in NAMES)
    model = WorldModel.of({**SKILLS, **OWN}, PLACES, (cup(1),), robots, ())
    return model.with_facts(
        {
            **{FactKey("holding", name): "nothing" for name in NAMES},
            **{FactKey("at", name): "kitchen" for name in NAMES},
            **{FactKey("battery", name): level for name, level in battery.items()},
            **{FactKey("charged", name): more.get("charged") for name in NAMES},
        }
    )


def goal(relation: str) -> Goal:
    condition = Condition(relation=relation, subject="kitchen", value=True)
    return Goal(goal="g", text="", conditions=(condition,))


@pytest.mark.parametrize("allocator", ["makespan", "milp", "balanced", "round-robin"])
@pytest.mark.parametrize(
    ("relation", "battery", "robot"),
    [
        ("shiny", {"r1": 10, "r2": 50}, "r2"),
        ("shiny", {"r1": 50, "r2": 10}, "r1"),
        ("lifted", {"r1": 50, "r2": 10}, "r2"),
        ("lifted", {"r1": 10, "r2": 50}, "r1"),
    ],
)
def test_the_robot_is_taken_of_which_the_formulas_hold(
    relation: str, battery: dict[str, int], robot: str, allocator: str
) -> None:
    made = PARTS.planners["symbolic"].plan(PlanningProblem("p", (goal(relation),), world(battery)))
    assert isinstance(made, CheckedPlan), made.reason
    assert set(made.able.values()) == {(robot,)}
    found = PARTS.allocators[allocator].allocate(made)
    assert isinstance(found, Allocated), found.violations
    assert set(found.allocation.values()) == {robot}


def plan(*tasks: Task) -> Plan:
    return Plan(plan="p", goals=(), conditions=(), tasks=tasks)


def task(name: str, skill: str, actor: str, after: tuple[str, ...] = (), **args: str) -> Task:
    robot = {"robot": actor_arg(actor)}
    return Task(task=name, skill=skill, args={**robot, **args}, actor=actor, after=after)


POLISH = task("t1", "polish", "a1", place="kitchen")


def test_where_no_robot_is_as_a_formula_asks_that_is_said_before_one_is_chosen() -> None:
    (wrong,) = check_plan(plan(POLISH), world({"r1": 10, "r2": 10})).violations
    assert wrong.code == "no-robot"
    assert "t1 needs battery(r1) >= 20, which need not hold" in wrong.sentence


def test_what_another_actor_may_leave_of_its_robot_counts() -> None:
    """It may be the same robot: the check of the allocated plan says whether it is as needed."""
    both = plan(
        task("t1", "charge", "a1"), task("t2", "lift", "a2", after=("t1",), place="kitchen")
    )
    model = world({"r1": 10, "r2": 50}, charged=False)
    checked = check_plan(both, model)
    assert isinstance(checked, CheckedPlan), checked.violations
    order = {"t2": ("t1",)}
    assert not check_allocation(both, model, {"a1": "r1", "a2": "r1"}, order)
    assert check_allocation(both, model, {"a1": "r2", "a2": "r2"}, order)
    assert check_allocation(both, model, {"a1": "r1", "a2": "r2"}, order)
