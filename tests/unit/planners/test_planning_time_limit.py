"""A planner whose time is over gives what it has, whenever that is; time here is steps."""

from __future__ import annotations

from dataclasses import replace

import pytest
from msgspec.structs import replace as replace_fields

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.jobshop.time_budget import StepClock, TimeBudget
from fleet.planners.base import BIG_DAG, MONOLITHIC, PER_GOAL, NoPlan, PlanningProblem
from fleet.planners.contradictions import contradictions
from fleet.planners.oversubscription import PartialPlan, plan_reachable_goals
from fleet.planners.plan_repair import repair_plan
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.payloads.goals import Goal
from tests.support.household import at, bring, drives, fact, home, manipulator

PLANNER = SymbolicPlanner()
ROOMS = ("hallway", "living_room")
GOALS = tuple(bring(n, ROOMS[n % 2]) for n in range(1, 6))
WORLD = home(cups=5)
ENOUGH = 1 << 20
"""Steps in which any of these problems is solved."""


def steps(number: int) -> TimeBudget:
    return TimeBudget(float(number), StepClock(1.0))


def problem(number: int, strategy: str = BIG_DAG) -> PlanningProblem:
    return PlanningProblem("p", GOALS, WORLD, strategy=strategy, budget=steps(number))


@pytest.mark.parametrize("strategy", [BIG_DAG, PER_GOAL, MONOLITHIC])
def test_the_longer_the_time_the_more_goals_are_planned_for(strategy: str) -> None:
    planned: list[int] = []
    number = 1
    while number <= ENOUGH:
        made = PLANNER.plan(problem(number, strategy))
        if isinstance(made, NoPlan):
            assert made.postponed
            assert made.reason == f"not planned within {number:g} s"
            planned.append(0)
        else:
            # It is a valid plan of whole goals, and promises what they want.
            wanted = {c for goal in GOALS if goal.goal in made.plan.goals for c in goal.conditions}
            assert set(made.plan.conditions) == wanted
            assert {task.goal for task in made.plan.tasks} == set(made.plan.goals)
            planned.append(len(made.plan.goals))
        # Once all are planned for, that is so in any longer time.
        number = ENOUGH if planned[-1] == len(GOALS) and number < ENOUGH else 2 * number
    assert planned == sorted(planned)
    assert planned[0] == 0
    assert planned[-1] == len(GOALS)
    assert len(set(planned)) > 2, "there is something between nothing and all"


def test_with_all_the_time_a_plan_is_that_without_a_limit() -> None:
    without = PLANNER.plan(replace(problem(1), budget=PlanningProblem("p", (), WORLD).budget))
    made = PLANNER.plan(problem(ENOUGH))
    assert isinstance(made, CheckedPlan)
    assert isinstance(without, CheckedPlan)
    assert made.plan == without.plan


def between() -> int:
    """Steps that suffice for some of the goals."""
    for number in range(1, ENOUGH):
        made = PLANNER.plan(problem(number))
        if isinstance(made, CheckedPlan):
            return number
    raise AssertionError("never enough")


def test_goals_for_which_there_was_no_time_are_postponed_and_not_left_out() -> None:
    number = between()
    made = plan_reachable_goals(PLANNER, PLANNER, problem(number))
    assert isinstance(made, PartialPlan)
    assert made.left_out == {}
    assert set(made.plan.goals) | made.postponed.keys() == {goal.goal for goal in GOALS}
    assert set(made.postponed.values()) == {f"not planned within {number} s"}
    assert set(made.not_in_time) == made.postponed.keys()
    assert made.plan.goals
    assert made.incomplete


def test_a_goal_out_of_reach_is_no_matter_of_time() -> None:
    nowhere = Goal(goal="g9", text="", conditions=(at("cup_1", "nowhere"),))
    out_of_reach = replace(problem(ENOUGH), goals=(*GOALS[1:3], nowhere))
    made = plan_reachable_goals(PLANNER, PLANNER, out_of_reach)
    assert isinstance(made, PartialPlan)
    assert set(made.left_out) == {"g9"}
    assert made.postponed == {}


def test_a_plan_is_repaired_though_the_time_does_not_suffice_for_a_new_goal() -> None:
    world = home(facts=(fact("hsr", "at", "hallway"),))
    residual = replace_fields(drives("hsr"), goals=("driven",))
    goals = (Goal(goal="driven", text="", conditions=(at("hsr", "kitchen"),)), bring(1, "hallway"))
    asked = PlanningProblem("p", goals, world, first_task=5, budget=steps(1))
    made = repair_plan(residual, asked, PLANNER, PLANNER, frozenset())
    assert made is not None
    assert made.plan.goals == ("driven",)
    assert made.plan.tasks == residual.tasks
    assert made.postponed == {"g1": "not planned within 1 s"}
    assert made.not_in_time == ("g1",)
    in_time = replace(asked, budget=steps(ENOUGH))
    again = repair_plan(residual, in_time, PLANNER, PLANNER, frozenset())
    assert again is not None
    assert again.plan.goals == ("driven", "g1")
    assert not again.incomplete


@pytest.mark.parametrize("number", [2, 12])
def test_full_hands_do_not_multiply_what_is_looked_at(number: int) -> None:
    robots = tuple(manipulator(f"r{n}") for n in range(1, number + 1))
    holding = [fact(f"r{n}", "holding", f"cup_{n}") for n in range(1, number + 1)]
    held = [fact(f"cup_{n}", "at", f"r{n}") for n in range(1, number + 1)]
    world = home(robots, number + 1, (*holding, *held))
    for wanted in (bring(1, "hallway"), bring(number + 1, "hallway")):
        made = PLANNER.plan(PlanningProblem("p", (wanted,), world, budget=steps(10_000)))
        assert isinstance(made, CheckedPlan), made


def test_contradictions_are_looked_for_within_the_time() -> None:
    many = tuple(replace_fields(bring(1, "hallway"), goal=f"g{n}") for n in range(1, 9))
    against = replace_fields(bring(1, "kitchen"), goal="g9", ordinal=9)
    asked = replace(problem(ENOUGH), goals=(*many, against))
    assert contradictions(PLANNER, asked) == {"g9": "g1"}
    made = plan_reachable_goals(PLANNER, PLANNER, asked)
    assert isinstance(made, PartialPlan)
    assert (set(made.postponed), made.not_in_time) == ({"g9"}, ())
    assert contradictions(PLANNER, replace(asked, budget=steps(1))) == {}
