"""No plan for a mission is shorter than its bound: not the optimum, and no other valid plan."""

from __future__ import annotations

from math import inf
from random import Random

from hypothesis import assume, given, settings
from hypothesis import strategies as st

from benchmarks.planning.optimum import TICKS_PER_S, least_makespan
from benchmarks.planning.small_scenes import scene
from fleet.core.checker.plan_checker import CheckedPlan, check_plan
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.mission_bound import mission_bound_s
from fleet.scheduling.plan_schedule import AllocatedPlan, PlanSchedule
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.plans import Plan
from tests.support.random_kitchen_plans import ALLOCATION, kitchen_plans
from tests.support.reached import Reached, reaches


@reaches(least={"with carriers": 5, "near": 5})
@settings(max_examples=30, deadline=None)
@given(st.randoms(use_true_random=False), st.integers(1, 3), st.integers(0, 2))
def test_the_optimum_of_a_small_scene_is_not_below_it(
    reached: Reached, chance: Random, things: int, carts: int
) -> None:
    made = scene("any", chance, things, carts)
    bound_s = mission_bound_s(made.goals, made.world, TimeBudget(inf))
    optimum = least_makespan(made.world, made.goals)
    assert optimum is not None
    assert 0.0 < bound_s <= optimum.makespan_s + things / TICKS_PER_S
    reached["with carriers"] += carts > 0
    reached["near"] += bound_s > 0.6 * optimum.makespan_s


@reaches(least={"valid": 100, "bound": 10})
@settings(max_examples=600, deadline=None)
@given(kitchen_plans())
def test_no_valid_plan_is_below_it(reached: Reached, drawn: tuple[Plan, WorldModel]) -> None:
    plan, world = drawn
    checked = check_plan(plan, world)
    assume(isinstance(checked, CheckedPlan))
    assert isinstance(checked, CheckedPlan)
    schedule = AllocatedPlan(checked, ALLOCATION).valid_schedule()
    assume(isinstance(schedule, PlanSchedule))
    assert isinstance(schedule, PlanSchedule)
    goal = Goal(goal="g", text="", conditions=plan.conditions)
    bound_s = mission_bound_s([goal], world, TimeBudget(inf))
    assert bound_s <= schedule.makespan_s + 1e-6
    reached["valid"] += 1
    reached["bound"] += bound_s > 0.0
