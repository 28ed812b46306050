"""The symbolic planner and the allocator on households."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import pytest

from fleet.allocators.base import Allocated
from fleet.allocators.min_max_load import MinMaxLoadAllocator, TieBreak
from fleet.core.checker.plan_checker import (
    CheckedPlan,
    check_allocation,
)
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.world import WorldModel
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.facts import FactKey
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.world import Surface
from tests.support.household import (
    PLACES,
    SKILLS,
    at,
    bring,
    carrier,
    checked,
    fact,
    home,
    manipulator,
)


def solve(world: WorldModel, *goals: Goal, **more: object) -> Plan:
    made = SymbolicPlanner().plan(PlanningProblem("p", goals, world, **more))  # type: ignore[arg-type]
    assert isinstance(made, CheckedPlan), made
    return made.plan


def allocate(plan: Plan, world: WorldModel) -> Allocated:
    made = MinMaxLoadAllocator(TieBreak.TRAVEL).allocate(checked(plan, world))
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
    order = made.schedule.extra_after
    assert check_allocation(plan, world, made.allocation, order) == ()


def test_why_there_is_no_plan_is_said() -> None:
    def reason(world: WorldModel, *goals: Goal, **more: object) -> str:
        made = SymbolicPlanner().plan(PlanningProblem("p", goals, world, **more))  # type: ignore[arg-type]
        assert isinstance(made, NoPlan)
        return made.reason

    goal = bring(1, "hallway")
    lost = home(facts=(fact("cup_1", "at", None),))
    everywhere = frozenset(place.place for place in PLACES)
    assert "looked for in hallway, kitchen, living_room" in reason(lost, goal, searched=everywhere)
    blind = home(
        (
            carrier().__class__(
                robot="r", model="m", skills=("navigate",), capabilities={"drive": 1.0}
            ),
        ),
        facts=(fact("cup_1", "at", None),),
    )
    assert "can look for it" in reason(blind, goal)
    assert "locobot" in reason(home((carrier(),)), goal)
    assert "no robot is connected" in reason(home(()), goal)
    assert "choose one of" in reason(home(), goal, strategy="magic")


def test_what_nobody_knows_is_looked_for_everywhere_in_parallel() -> None:
    world = home(facts=(fact("cup_1", "at", None),))
    plan = solve(world, bring(1, "hallway"))
    assert plan.seeks == ("cup_1",)
    assert skills(plan).count("search") == len(PLACES)
    assert set(allocate(plan, world).allocation.values()) == {"hsr", "locobot"}
    rest = solve(world, bring(1, "hallway"), searched=frozenset({"kitchen"}))
    assert {t.args["place"] for t in rest.tasks if t.skill == "search"} == {
        "hallway",
        "living_room",
    }


def test_known_work_goes_on_while_something_else_is_looked_for() -> None:
    world = home(facts=(fact("cup_1", "at", None),))
    plan = solve(world, bring(1, "hallway"), bring(2, "living_room"))
    assert plan.seeks == ("cup_1",)
    assert "pick" in skills(plan)
    assert at("cup_2", "living_room") in plan.conditions
    assert at("cup_1", "hallway") not in plan.conditions


def test_some_cup_is_the_nearest_one() -> None:
    some = Condition(relation="at", subject="cup_1", any_of=("cup_1", "cup_2"), value="hallway")
    world = home(facts=(fact("cup_1", "at", None), fact("cup_2", "at", "living_room")))
    plan = solve(world, Goal(goal="g", text="", conditions=(some,)))
    assert {t.args["object"] for t in plan.tasks if "object" in t.args} == {"cup_2"}


@pytest.mark.parametrize(
    ("relation", "subject", "last"),
    [("held", "cup_1", "pick"), ("searched", "hallway", "search")],
)
def test_other_conditions_have_plans_too(relation: str, subject: str, last: str) -> None:
    goal = Goal(
        goal="g", text="", conditions=(Condition(relation=relation, subject=subject, value=True),)
    )
    assert skills(solve(home(), goal))[-1] == last


def test_an_object_whose_place_is_known_is_located() -> None:
    goal = Goal(
        goal="g", text="", conditions=(Condition(relation="located", subject="cup_1", value=True),)
    )
    assert solve(home(), goal).tasks == ()


@pytest.mark.parametrize("strategy", SymbolicPlanner.strategies)
def test_every_strategy_passes_the_checker(strategy: str) -> None:
    robots = (manipulator("r1"), manipulator("r2"), carrier())
    world = home(robots, cups=4)
    goals = [bring(n, "hallway" if n % 2 else "living_room") for n in range(1, 5)]
    plan = solve(world, *goals, strategy=strategy)
    made = allocate(plan, world)
    order = made.schedule.extra_after
    assert check_allocation(plan, world, made.allocation, order) == ()
    assert plan.strategy == strategy


def test_choosing_for_all_goals_together_is_at_least_as_fast() -> None:
    world = home(facts=(fact("hsr", "at", "living_room"), fact("locobot", "at", "hallway")))
    goals = (bring(1, "hallway"), bring(2, "living_room"))
    makespan = {
        strategy: allocate(solve(world, *goals, strategy=strategy), world).schedule.makespan_s
        for strategy in SymbolicPlanner.strategies
    }
    assert makespan["big-dag"] < makespan["per-goal"]
    assert makespan["big-dag"] < makespan["monolithic"]


def test_the_least_work_of_all_robots_may_take_longer() -> None:
    stand = (fact("r1", "at", "kitchen"), fact("r2", "at", "living_room"))
    world = home((manipulator("r1"), manipulator("r2")), facts=stand)
    goals = (bring(1, "living_room"), bring(2, "living_room"))

    def spent(strategy: str) -> tuple[float, float]:
        schedule = allocate(solve(world, *goals, strategy=strategy), world).schedule
        return schedule.makespan_s, sum(schedule.durations_s.values())

    makespan_s, work_s = spent("big-dag")
    longer_s, less_s = spent("least-work")
    assert less_s <= work_s
    assert longer_s >= makespan_s


def test_a_skill_of_a_users_own_is_planned_with() -> None:
    mop = {
        "about": "Mop a floor, with the mop in the hand.",
        "parameters": {"robot": "robot", "place": "place", "mop": "object"},
        "needs": {"robot": ["grip"]},
        "before": ["at(robot) = place", "holding(robot) = mop"],
        "after": ["clean(place) = true"],
        "duration_s": 60,
    }
    skills_known = {**SKILLS, **skills_from_data({"skills": {"mop": mop}}, "test")}
    spec = manipulator()
    handy = type(spec)(
        robot="hsr", model="hsr", skills=(*spec.skills, "mop"), capabilities=spec.capabilities
    )
    world = home((handy,))
    world = replace(world, skills=skills_known)
    clean = Condition(relation="clean", subject="hallway", value=True)
    plan = solve(world, Goal(goal="g", text="", conditions=(clean,)))
    assert skills(plan) == ["navigate", "pick", "navigate", "mop"]


def test_what_lies_too_high_or_is_too_heavy_is_left_to_another_robot() -> None:
    shelf = Surface(surface="shelf", x_m=0, y_m=0, z_m=1.5, yaw_rad=0, length_m=1, width_m=0.4)
    spec = manipulator("tall")
    tall = type(spec)(
        robot="tall",
        model="m",
        skills=spec.skills,
        capabilities={**spec.capabilities, "reach": 1.8},
    )
    world = home((manipulator("small"), tall))
    kitchen = msgspec.structs.replace(world.places["kitchen"], surfaces=(shelf,))
    world = replace(world, places={**world.places, "kitchen": kitchen})
    made = allocate(solve(world, bring(1, "hallway")), world)
    assert set(made.allocation.values()) == {"tall"}
    only_small = replace(world, available=frozenset({"small"}))
    refused = SymbolicPlanner().plan(PlanningProblem("p", (bring(1, "hallway"),), only_small))
    assert isinstance(refused, NoPlan)


def test_a_robot_that_is_to_get_something_gets_it() -> None:
    robots = (manipulator(), carrier("l1"), carrier("l2"))
    goal = Goal(goal="g", text="", conditions=(at("cup_1", "l2"),))
    world = home(robots)
    made = allocate(solve(world, goal), world)
    assert set(made.allocation.values()) == {"hsr", "l2"}


def test_goals_that_want_the_same_helper_are_still_planned_one_by_one() -> None:
    world = home(cups=4)
    goals = [bring(n, "living_room") for n in range(1, 5)]
    plan = solve(world, *goals, strategy="per-goal")
    assert allocate(plan, world)


def test_the_order_of_work_that_reaches_every_goal_is_taken_even_if_it_is_longer() -> None:
    world = home((manipulator(),), facts=(fact("hsr", "at", "kitchen"),))
    stay = Goal(goal="s", text="", conditions=(at("hsr", "kitchen"),), ordinal=2)
    world = world.with_facts({FactKey("at", "hsr"): "hallway"})
    plan = solve(world, bring(1, "living_room"), stay)
    made = allocate(plan, world)
    order = made.schedule.extra_after
    assert check_allocation(plan, world, made.allocation, order) == ()


@pytest.mark.parametrize("first", [1, 9])
def test_what_is_there_in_a_basket_is_taken_out_before_its_carrier_has_to_leave(first: int) -> None:
    """Or brought back, but not carried away for good."""
    arm = manipulator()
    arm = msgspec.structs.replace(arm, skills=(*arm.skills, "pick_from_robot"))
    facts = (fact("locobot", "at", "hallway"), fact("cup_1", "at", "locobot"))
    world = home((arm, carrier()), cups=2, facts=facts)
    there = msgspec.structs.replace(bring(1, "hallway"), ordinal=first)
    leave = Goal(goal="l", text="", conditions=(at("locobot", "living_room"),), ordinal=5)
    plan = solve(world, there, leave, bring(2, "living_room"))
    assert "pick_from_robot" in skills(plan)
    assert allocate(plan, world)
