"""Tasks that no connected robot can do."""

from __future__ import annotations

from fleet.core.actors import tasks_nobody_can_do
from fleet.core.checker.plan_checker import CheckedPlan, InvalidPlan, check_plan
from fleet.planners.base import PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from tests.support.household import bring, carrier, home, manipulator


def test_tasks_that_nobody_can_do_are_named_with_what_is_lacking() -> None:
    made = SymbolicPlanner().plan(PlanningProblem("p", (bring(1, "hallway"),), home()))
    assert isinstance(made, CheckedPlan)
    world = home((carrier("c1"), manipulator("weak", grip_kg=0.1)))
    invalid = check_plan(made.plan, world)
    assert isinstance(invalid, InvalidPlan)
    violations = tasks_nobody_can_do(invalid)
    pick = next(row.task for row in made.plan.tasks if row.skill == "pick")
    assert violations[0].task == pick
    sentence = violations[0].sentence
    assert sentence.startswith(f"no robot can do task {pick}, pick: ")
    assert "c1 does not have the skill pick" in sentence
    assert "cup_1 weighs 0.15 kg; weak lifts 0.1 kg" in sentence
