"""Conditions that any of many things can meet, counts, and what constraints leave no way to."""

from __future__ import annotations

import pytest

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import StepClock, TimeBudget
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object
from tests.support.household import PLACES, SKILLS, at, fact, manipulator

STEPS = 4_000
"""Readings of the clock in which each of these is found; looking at every thing takes far more."""
WHERE = {"robot": "robot", "place": "place"}
OWN = {
    "run_machine": {
        "parameters": {**WHERE, "machine": "dishwasher"},
        "before": [
            "at(robot) = place",
            "at(machine) = place",
            "is_open(machine) = false",
            "any(x: movable, in(x) = machine)",
        ],
        "after": ["all(x: dish, if in(x) = machine: clean(x) = true)"],
        "duration_s": 75,
    },
    "serve": {
        "parameters": {**WHERE, "table": "table"},
        "before": ["at(robot) = place", "at(table) = place", "count(x: dish, on(x) = table) >= 3"],
        "after": ["served(table) = true"],
        "duration_s": 10,
    },
    "lay": {
        "parameters": {**WHERE, "table": "table"},
        "before": ["at(robot) = place", "at(table) = place", "2 > count(x: food, on(x) = table)"],
        "after": ["laid(table) = true"],
        "duration_s": 10,
    },
    "rinse": {
        "parameters": {"robot": "robot", "cup": "cup"},
        "before": ["holding(robot) = cup"],
        "after": [
            "rinsed(cup) = true",
            "if fragile(cup): holding(robot) = nothing",
            "if fragile(cup): at(cup) = bin",
        ],
        "duration_s": 20,
    },
    "toast": {
        "parameters": {**WHERE, "table": "table"},
        "before": [
            "at(robot) = place",
            "at(table) = place",
            "any(x: cup, on(x) = table and rinsed(x) = true)",
        ],
        "after": ["toasted(table) = true"],
        "duration_s": 10,
    },
}
ALL = {**SKILLS, **skills_from_data({"skills": OWN}, "own.yaml")}


def thing(name: str, kind: str, *features: str, **more: object) -> Object:
    return Object(
        object=name,
        kind=kind,
        label=name,
        features=features,
        mass_kg=0.2,
        **more,  # type: ignore[arg-type]
    )


def fixed(name: str, kind: str, home: str, *features: str) -> Object:
    return thing(name, kind, *features, movable=False, home=home)


def arm(name: str) -> RobotSpec:
    spec = manipulator(name)
    return RobotSpec(
        robot=name, model=spec.model, skills=tuple(ALL), capabilities=spec.capabilities
    )


def flat(*facts: Fact, things: tuple[Object, ...] = ()) -> WorldModel:
    """Three rooms, two dozen dishes that things can be in, and furniture."""
    dishes = tuple(thing(f"dish_{n}", "bowl", "contains", categories=("dish",)) for n in range(24))
    shelves = tuple(
        fixed(f"shelf_{n}", "shelf", ("kitchen", "hallway")[n % 2], "supports", "contains")
        for n in range(8)
    )
    furniture = (
        fixed("dishwasher", "dishwasher", "kitchen", "contains", "openable"),
        fixed("table", "table", "living_room", "supports"),
        fixed("bin", "bin", "hallway", "contains"),
    )
    known = [fact("hsr", "holding", "nothing"), fact("hsr", "at", "living_room")]
    known += [fact(f"dish_{n}", "at", f"shelf_{n % 8}") for n in range(24)]
    objects = (*dishes, *shelves, *furniture, *things)
    return WorldModel.of(ALL, PLACES, objects, (arm("hsr"),), (*known, *facts))


def is_(relation: str, subject: str, value: bool = True) -> Condition:
    return Condition(relation=relation, subject=subject, value=value)


def made(
    world: WorldModel,
    *conditions: Condition,
    never: tuple[Condition, ...] = (),
    always: tuple[Condition, ...] = (),
) -> CheckedPlan | NoPlan:
    goal = Goal(goal="g", text="", conditions=conditions, never=never, always=always)
    budget = TimeBudget(float(STEPS), StepClock(1.0))
    return SymbolicPlanner().plan(PlanningProblem("p", (goal,), world, budget=budget))


def planned(world: WorldModel, *conditions: Condition) -> Plan:
    found = made(world, *conditions)
    assert isinstance(found, CheckedPlan), found.reason
    return found.plan


def handled(plan: Plan, skill: str) -> list[str]:
    return [task.args["object"] for task in plan.tasks if task.skill == skill]


def test_what_shall_be_washed_is_what_is_put_in_the_machine() -> None:
    plan = planned(flat(), is_("clean", "dish_7"))
    assert handled(plan, "place_in") == ["dish_7"]
    assert "run_machine" in [task.skill for task in plan.tasks]


def test_what_is_to_be_in_a_machine_is_brought_from_another_room() -> None:
    plan = planned(flat(fact("dish_7", "at", "living_room")), is_("clean", "dish_7"))
    assert handled(plan, "place_in") == ["dish_7"]


def test_as_many_as_are_counted_are_brought_the_nearest_first() -> None:
    near = {"dish_3", "dish_11", "dish_20"}
    world = flat(*(fact(name, "at", "living_room") for name in near))
    plan = planned(world, is_("served", "table"))
    assert set(handled(plan, "place_on")) == near


def test_what_counts_already_is_not_brought() -> None:
    world = flat(*(fact(f"dish_{n}", "at", "table") for n in (1, 2)))
    plan = planned(world, is_("served", "table"))
    (brought,) = handled(plan, "place_on")
    assert brought not in ("dish_1", "dish_2")


def test_of_what_is_too_many_only_the_rest_is_taken_away() -> None:
    foods = tuple(thing(f"food_{n}", "apple", categories=("food",)) for n in range(9))
    on_it = [fact(food.object, "at", "table") for food in foods[:4]]
    rest = [fact(food.object, "at", "kitchen") for food in foods[4:]]
    plan = planned(flat(*on_it, *rest, things=foods), is_("laid", "table"))
    picked = handled(plan, "pick")
    assert len(picked) == 3
    assert set(picked) <= {food.object for food in foods[:4]}


def test_where_the_likeliest_things_lead_nowhere_all_others_are_looked_at() -> None:
    cups = tuple(thing(f"cup_{n}", "cup", *("fragile",) if n else ()) for n in range(7))
    known = [fact(cup.object, "at", "living_room") for cup in cups[1:]]
    world = WorldModel.of(
        ALL,
        PLACES,
        (
            *cups,
            fixed("table", "table", "living_room", "supports"),
            fixed("bin", "bin", "hallway", "openable"),
        ),
        (arm("hsr"),),
        (fact("hsr", "holding", "nothing"), fact("cup_0", "at", "kitchen"), *known),
    )
    plan = planned(world, is_("toasted", "table"))
    assert handled(plan, "place_on") == ["cup_0"]


@pytest.mark.parametrize(
    ("goal", "never", "always", "why"),
    [
        (
            at("dish_0", "table"),
            is_("is_open", "cupboard"),
            None,
            "open(cupboard, kitchen) leads to is_open(cupboard) = true, which must never hold",
        ),
        (
            at("dish_0", "table"),
            None,
            is_("is_open", "cupboard", False),
            "open(cupboard, kitchen) goes against is_open(cupboard) = false, "
            "which must always hold",
        ),
        (
            at("dish_1", "table"),
            at("hsr", "living_room"),
            None,
            "at(hsr) = living_room must never hold, and does at the start",
        ),
        (
            at("dish_1", "table"),
            at("dish_1", "living_room"),
            None,
            "place_on(dish_1, table, living_room) leads to at(dish_1) = living_room, "
            "which must never hold",
        ),
    ],
)
def test_what_forbids_the_only_way_is_named_without_looking_at_every_detour(
    goal: Condition, never: Condition | None, always: Condition | None, why: str
) -> None:
    cupboard = fixed("cupboard", "cupboard", "kitchen", "contains", "openable")
    closed = Fact(subject="cupboard", relation="is_open", value=False, source="test")
    world = flat(fact("dish_0", "at", "cupboard"), closed, things=(cupboard,))
    refused = made(
        world,
        goal,
        never=(never,) if never else (),
        always=(always,) if always else (),
    )
    assert isinstance(refused, NoPlan)
    assert not refused.postponed
    assert why in refused.reason
