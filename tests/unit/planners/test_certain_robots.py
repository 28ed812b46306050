"""Goals that certain robots shall do: nobody else is planned, allocated or accepted for them."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fleet.core import events
from fleet.core.checker.plan_checker import InvalidPlan, check_allocation, check_plan
from fleet.core.model.world import WorldModel
from fleet.planners.base import PlanningProblem
from fleet.planners.llm.prompt_text import problem_text
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.payloads.goals import Goal, GoalState
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.requests import PlanRequest
from tests.support.fleet_model import COMPOSITION, FleetModel
from tests.support.household import at, bring, carrier, manipulator

ROBOTS = (manipulator(), manipulator("arm"), carrier())


def fleet(*robots: str) -> FleetModel:
    return FleetModel(tuple(r for r in ROBOTS if r.robot in robots or not robots), cups=3)


def by(robot: str, number: int = 1) -> Goal:
    return replace(bring(number, "hallway"), by=(robot,))


def doers(model: FleetModel, goal: str) -> set[str | None]:
    records = (r for entry in model.plans.values() for r in entry.records.values())
    return {record.robot for record in records if record.goal == goal}


@pytest.mark.parametrize("strategy", SymbolicPlanner.strategies)
def test_only_who_shall_do_it_is_planned_for_it(strategy: str) -> None:
    model = fleet()
    goals = (by("arm", 1), by("arm", 2), bring(3, "hallway"))
    model.plan(*goals, strategy=strategy)
    model.finish()
    assert doers(model, "g1") == doers(model, "g2") == {"arm"}
    assert all(model.goal_state(goal.goal) is GoalState.REACHED for goal in goals)


@pytest.mark.parametrize("allocator", sorted(set(COMPOSITION.allocators) - {"llm"}))
def test_every_allocator_takes_only_those(allocator: str) -> None:
    model = fleet()
    model.plan(
        replace(bring(1, "hallway"), by=("arm", "locobot")), by("hsr", 2), allocator=allocator
    )
    model.finish()
    assert doers(model, "g1") <= {"arm", "locobot"}
    assert doers(model, "g2") == {"hsr"}


def test_one_that_cannot_is_named_with_what_it_lacks() -> None:
    model = fleet()
    model.plan(by("locobot"))
    answer = model.replies["r0"]
    assert not answer.accepted
    assert "locobot, who shall do it," in answer.sentence
    assert "locobot does not have the skill" in answer.sentence
    assert answer.sentence.endswith("who else may help must be named with them")


def test_a_sentence_says_who_shall_do_it() -> None:
    model = fleet()
    text = "The arm shall bring cup 1 to the hallway and the hsr shall bring cup 2 to the hallway"
    model.receive(events.GoalPut, goal=Goal(goal="g", text=text))
    assert model.goal_states["g"].parts == ("g.1", "g.2")
    model.receive(events.PlanRequested, request=PlanRequest(request="r", goals=("g",)))
    model.finish()
    assert (doers(model, "g.1"), doers(model, "g.2")) == ({"arm"}, {"hsr"})
    assert model.goal_state("g") is GoalState.REACHED


@pytest.mark.parametrize(
    ("who", "says"), [("nobody", "'nobody', who shall do it, is no robot"), ("arm", "say one of")]
)
def test_who_shall_do_it_must_be_a_robot_and_the_same_in_both(who: str, says: str) -> None:
    model = fleet()
    text = (
        "The hsr shall bring cup 1 to the hallway" if who == "arm" else "Bring cup 1 to the hallway"
    )
    model.receive(events.GoalPut, goal=Goal(goal="g", text=text, by=(who,)))
    assert model.goal_state("g") is GoalState.REJECTED
    assert says in (model.goal_states["g"].reason or "")


def test_when_that_robot_is_lost_the_goal_waits_for_it() -> None:
    model = fleet()
    model.plan(by("arm"))
    model.lose("arm")
    model.finish()
    assert model.goal_state("g1") is GoalState.WAITING
    assert "arm" in (model.goal_states["g1"].reason or "")
    model.return_("arm")
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    assert doers(model, "g1") == {"arm"}


def _planned(model: FleetModel) -> tuple[Plan, WorldModel]:
    """A plan for a goal that anybody may do, and the world of it."""
    world = model.state.world()
    problem = PlanningProblem("p", (bring(1, "hallway"),), world)
    made = SymbolicPlanner().plan(problem)
    assert not isinstance(made, InvalidPlan)
    plan = made.plan  # type: ignore[union-attr]
    return replace(plan, by={"g1": ("arm",)}), world


def test_the_checker_lets_nobody_else_be_its_actor() -> None:
    plan, world = _planned(fleet())
    checked = check_plan(plan, world)
    assert {robot for robots in checked.able.values() for robot in robots} == {"arm"}
    wrong = check_allocation(plan, world, dict.fromkeys(plan.actors, "hsr"))
    assert any("which arm shall do, not hsr" in each.sentence for each in wrong)
    assert not check_allocation(plan, world, dict.fromkeys(plan.actors, "arm"))
    other = check_plan(replace(plan, by={"g1": ("locobot",)}), world)
    assert "locobot does not have the skill" in other.violations[0].sentence


def test_a_proposed_plan_for_such_a_goal_is_held_to_it() -> None:
    model = fleet()
    plan, _ = _planned(model)
    model.receive(events.GoalPut, goal=by("arm"))
    pins = dict.fromkeys(plan.actors, "hsr")
    model.receive(events.PlanProposed, plan=replace(plan, by={}, pins=pins))
    assert "hsr" in (model.plans["p"].reason or "")
    assert not model.orders()


def test_a_language_model_is_told_who_shall_do_it() -> None:
    world = fleet().state.world()
    assert '"only_by":["arm"]' in "".join(problem_text(world, [by("arm")]).split())
    assert "only_by" not in problem_text(world, [bring(1, "hallway")])
    assert at("cup_1", "hallway") in by("arm").conditions
