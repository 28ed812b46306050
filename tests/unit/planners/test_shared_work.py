"""Work that is done once for several conditions: a machine for all dishes, a tray for all cups."""

from __future__ import annotations

import msgspec

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.world import WorldModel
from fleet.planners.base import PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.world import Fact, Object
from tests.support.household import PLACES, SKILLS, at, fact, manipulator

WASH = {
    "run": {
        "parameters": {"robot": "robot", "machine": "dishwasher", "place": "place"},
        "before": [
            "at(robot) = place",
            "at(machine) = place",
            "is_open(machine) = false",
            "any(x: dish, in(x) = machine)",
        ],
        "after": ["all(x: dish, if in(x) = machine: washed(x) = true)"],
        "duration_s": 50,
    },
}
ALL = {**SKILLS, **skills_from_data({"skills": WASH}, "wash.yaml")}
ARM = msgspec.structs.replace(manipulator(), skills=tuple(ALL))


def planned(objects: tuple[Object, ...], facts: tuple[Fact, ...], *goals: Goal) -> list[str]:
    known = (*facts, fact("hsr", "holding", "nothing"), fact("hsr", "at", "kitchen"))
    world = WorldModel.of(ALL, PLACES, objects, (ARM,), known)
    found = SymbolicPlanner().plan(PlanningProblem("p", goals, world))
    assert isinstance(found, CheckedPlan), found.reason
    return [task.skill for task in found.plan.tasks]


def dishes(room: float | None = None) -> tuple[tuple[Object, ...], tuple[Fact, ...]]:
    machine = Object(
        object="machine",
        kind="dishwasher",
        label="",
        movable=False,
        home="hallway",
        features=("contains", "openable"),
        room=room,
    )
    plates = tuple(
        Object(object=f"plate_{n}", kind="plate", label="", categories=("dish",)) for n in range(3)
    )
    closed = Fact(subject="machine", relation="is_open", value=False, source="test")
    facts = (closed, *(fact(plate.object, "at", "kitchen") for plate in plates))
    return (machine, *plates), facts


def washed(*plates: int) -> tuple[Condition, ...]:
    return tuple(Condition(relation="washed", subject=f"plate_{n}", value=True) for n in plates)


def test_a_machine_is_run_once_for_all_that_is_in_it() -> None:
    together = planned(*dishes(), Goal(goal="g", text="", conditions=washed(0, 1, 2)))
    assert together.count("run") == 1
    apart = (Goal(goal=f"g{n}", text="", conditions=washed(n)) for n in range(3))
    assert planned(*dishes(), *apart).count("run") == 1


def test_a_machine_that_has_no_room_for_all_is_run_again() -> None:
    goal = Goal(goal="g", text="", conditions=washed(0, 1, 2))
    assert planned(*dishes(room=2), goal).count("run") == 2


def test_a_tray_is_loaded_before_it_is_carried() -> None:
    tray = Object(object="tray", kind="tray", label="", features=("supports",))
    cups = tuple(Object(object=f"cup_{n}", kind="cup", label="") for n in range(2))
    on = (Condition(relation="on", subject=cup.object, value="tray") for cup in cups)
    goal = Goal(goal="g", text="", conditions=(at("tray", "living_room"), *on))
    facts = tuple(fact(thing.object, "at", "kitchen") for thing in (tray, *cups))
    assert planned((tray, *cups), facts, goal).count("navigate") == 2
