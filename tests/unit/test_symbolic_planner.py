"""The symbolic planner and the allocator on households."""

from __future__ import annotations

from fleet.allocators.base import Allocated, NotAllocated
from fleet.allocators.milp import MilpAllocator
from fleet.core.checker import check_plan
from fleet.core.world_model import WorldModel
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.planners.symbolic import SymbolicPlanner
from keyexpr_schema.goals import Goal
from keyexpr_schema.plans import Plan
from tests.household import at, bring, carrier, fact, home, manipulator


def solve(world: WorldModel, *goals: Goal, **more: object) -> Plan:
    made = SymbolicPlanner().plan(PlanningProblem("p", goals, world, **more))  # type: ignore[arg-type]
    assert isinstance(made, Plan), made
    return made


def allocate(plan: Plan, world: WorldModel) -> Allocated:
    made = MilpAllocator().allocate(plan, world)
    assert isinstance(made, Allocated), made
    return made


def skills(plan: Plan) -> list[str]:
    return [task.skill for task in plan.tasks]


def test_two_cups_two_robots_are_shared_by_a_handover() -> None:
    world = home(facts=(fact("hsr", "at", "living_room"), fact("locobot", "at", "hallway")))
    plan = solve(world, bring(1, "hallway"), bring(2, "living_room"))
    made = allocate(plan, world)
    assert "place_on_robot" in skills(plan)
    assert set(made.allocation.values()) == {"hsr", "locobot"}
    alone = solve(home((manipulator(),)), bring(1, "hallway"), bring(2, "living_room"))
    assert made.schedule.makespan_s < allocate(alone, home((manipulator(),))).schedule.makespan_s


def test_one_goal_is_not_made_longer_than_it_is() -> None:
    plan = solve(home(), bring(1, "hallway"))
    assert skills(plan) == ["navigate", "pick", "navigate", "place"]
    assert len({task.actor for task in plan.tasks}) == 1


def test_a_goal_that_holds_needs_no_task() -> None:
    assert solve(home(), bring(1, "kitchen")).tasks == ()


def test_two_manipulators_share_the_work() -> None:
    world = home((manipulator("r1"), manipulator("r2")))
    made = allocate(solve(world, bring(1, "hallway"), bring(2, "living_room")), world)
    assert set(made.allocation.values()) == {"r1", "r2"}


def test_a_robot_that_already_holds_the_cup_keeps_it() -> None:
    world = home(
        (manipulator("r1"), manipulator("r2")),
        facts=(fact("cup_1", "at", "r2"), fact("r2", "holding", "cup_1")),
    )
    plan = solve(world, bring(1, "hallway"))
    assert skills(plan) == ["navigate", "place"]
    assert allocate(plan, world).allocation == {plan.tasks[0].actor: "r2"}


def test_another_thing_in_the_hand_is_put_down_first() -> None:
    world = home(
        (manipulator(),), facts=(fact("cup_2", "at", "hsr"), fact("hsr", "holding", "cup_2"))
    )
    plan = solve(world, bring(1, "hallway"))
    assert allocate(plan, world)
    assert skills(plan).count("place") == 2


def test_robots_can_be_sent() -> None:
    goal = Goal(goal="g", text="", conditions=(at("locobot", "kitchen"),))
    plan = solve(home(), goal)
    made = allocate(plan, home())
    assert made.allocation == {"a1": "locobot"}


def test_ten_cups_and_five_robots() -> None:
    robots = (manipulator("r1"), manipulator("r2"), manipulator("r3"), carrier(), carrier("l2"))
    world = home(robots, cups=10)
    goals = [bring(n, "hallway" if n % 2 else "living_room") for n in range(1, 11)]
    plan = solve(world, *goals)
    made = allocate(plan, world)
    final = check_plan(plan, world, made.allocation, made.schedule.extra_after)
    assert final.valid


def test_why_there_is_no_plan_is_said() -> None:
    def reason(world: WorldModel, *goals: Goal, **more: object) -> str:
        made = SymbolicPlanner().plan(PlanningProblem("p", goals, world, **more))  # type: ignore[arg-type]
        assert isinstance(made, NoPlan)
        return made.reason

    goal = bring(1, "hallway")
    assert "where cup_1 is" in reason(home(facts=(fact("cup_1", "at", None),)), goal)
    assert "locobot" in reason(home((carrier(),)), goal)
    assert "no robot is connected" in reason(home(()), goal)
    assert "choose one of" in reason(home(), goal, strategy="magic")


def test_the_allocator_refuses_what_no_robot_can_do() -> None:
    plan = solve(home(), bring(1, "hallway"))
    refused = MilpAllocator().allocate(plan, home((carrier(),)))
    assert isinstance(refused, NotAllocated)
    assert "does not have the skill" in refused.violations[0].sentence
