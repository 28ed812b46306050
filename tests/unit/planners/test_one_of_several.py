"""Goals for one of several things that could all serve: a cup here, a cup there."""

from __future__ import annotations

import msgspec
import pytest

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.core.model.world import WorldModel
from fleet.planners.base import LEAST_WORK, PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.payloads.goals import Condition, Goal
from tests.support.household import PLACES, SKILLS, at, cup, fact, home, manipulator


def some_cup(place: str) -> Condition:
    return Condition(relation="at", subject="cup_1", value=place, any_of=("cup_1", "cup_2"))


def moved(world: WorldModel, *goals: tuple[Condition, ...], strategy: str = "big-dag") -> list[str]:
    asked = tuple(Goal(goal=f"g{n}", text="", conditions=c) for n, c in enumerate(goals))
    found = SymbolicPlanner().plan(PlanningProblem("p", asked, world, strategy=strategy))
    assert isinstance(found, CheckedPlan), found.reason
    return sorted(task.args["object"] for task in found.plan.tasks if task.skill == "pick")


@pytest.mark.parametrize("strategy", ["big-dag", LEAST_WORK])
def test_a_cup_here_and_a_cup_there_are_two_cups(strategy: str) -> None:
    one, two = some_cup("hallway"), some_cup("living_room")
    assert moved(home(), (one,), (two,), strategy=strategy) == ["cup_1", "cup_2"]
    assert moved(home(), (one, two), strategy=strategy) == ["cup_1", "cup_2"]


def test_the_cup_that_is_named_is_left_to_whom_it_was_named_for() -> None:
    assert moved(home(), (some_cup("hallway"),), (at("cup_1", "living_room"),)) == [
        "cup_1",
        "cup_2",
    ]


def test_what_another_robot_holds_is_in_no_basket() -> None:
    """A robot may have a hand and a basket: what is in the hand is taken from there by nobody."""
    spec = manipulator()
    taking = msgspec.structs.replace(spec, skills=(*spec.skills, "pick_from_robot"))
    both = msgspec.structs.replace(
        spec, robot="both", capabilities={**spec.capabilities, "basket": 2.0}
    )
    held = fact("cup_1", "at", "both"), fact("both", "holding", "cup_1")
    free = fact("hsr", "holding", "nothing")
    world = WorldModel.of(SKILLS, PLACES, (cup(1),), (taking, both), (*held, free))
    wanted = Goal(
        goal="g",
        text="",
        conditions=(Condition(relation="holding", subject="hsr", value="cup_1"),),
    )
    found = SymbolicPlanner().plan(PlanningProblem("p", (wanted,), world))
    assert isinstance(found, CheckedPlan), found.reason
    assert [t.skill for t in found.plan.tasks if "pick" in t.skill or "place" in t.skill] == [
        "place",
        "pick",
    ]
