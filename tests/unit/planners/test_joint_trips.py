"""Several things in one trip, and ways that nobody has to go."""

from __future__ import annotations

import pytest

from fleet.allocators.base import Allocated
from fleet.allocators.makespan import MakespanAllocator
from fleet.core.checker.plan_checker import CheckedPlan, check_plan
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import StepClock
from fleet.planners.base import BIG_DAG, MONOLITHIC, PER_GOAL, PlanningProblem
from fleet.planners.deordering import ActionSequence, deordered
from fleet.planners.symbolic.joint_trips import joined
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Object, Place
from tests.support.household import SKILLS, carrier, fact, manipulator

FAR_M = 100.0


def street(cups: int, *robots: RobotSpec) -> WorldModel:
    """Three places in a row, far from each other; cups, hands and carriers are at the first."""
    names = ("near", "middle", "far")
    places = [
        Place(
            place=name,
            label=name,
            travel_m={o: FAR_M * abs(i - j) for j, o in enumerate(names) if o != name},
        )
        for i, name in enumerate(names)
    ]
    things = [
        Object(object=f"cup_{n}", kind="cup", label=f"cup {n}", ordinal=n, mass_kg=0.1)
        for n in range(1, cups + 1)
    ]
    facts = [fact(thing.object, "at", "near") for thing in things]
    for spec in robots:
        facts.append(fact(spec.robot, "at", "near"))
        if "grip" in spec.capabilities:
            facts.append(fact(spec.robot, "holding", "nothing"))
    return WorldModel.of(SKILLS, places, things, robots, facts)


def to(cup: int, place: str) -> Goal:
    condition = Condition(relation="at", subject=f"cup_{cup}", value=place)
    return Goal(goal=f"g{cup}", text="", conditions=(condition,), ordinal=cup)


def planned(world: WorldModel, *goals: Goal, strategy: str = BIG_DAG) -> Plan:
    made = SymbolicPlanner().plan(PlanningProblem("p", goals, world, strategy=strategy))
    assert isinstance(made, CheckedPlan), made
    return made.plan


def drives_of_carriers(plan: Plan) -> list[str]:
    carriers = {t.args["carrier"] for t in plan.tasks if "carrier" in t.args}
    return [t.args["to"] for t in plan.tasks if t.args["robot"] in carriers and "to" in t.args]


def by_carrier(world: WorldModel, cup: int, place: str) -> ActionSequence:
    skills = world.skills
    steps = (
        ("navigate", {"robot": "hsr", "to": "near"}),
        ("pick", {"robot": "hsr", "object": f"cup_{cup}", "place": "near"}),
        ("navigate", {"robot": "locobot", "to": "near"}),
        (
            "place_on_robot",
            {"robot": "hsr", "object": f"cup_{cup}", "carrier": "locobot", "place": "near"},
        ),
        ("navigate", {"robot": "locobot", "to": place}),
    )
    return ActionSequence(f"g{cup}", tuple(skills[name].ground(args) for name, args in steps))


def test_a_carrier_takes_two_things_in_one_trip() -> None:
    slow = manipulator()
    world = street(2, slow, carrier())
    plan = planned(world, to(1, "far"), to(2, "far"))
    assert drives_of_carriers(plan) == ["near", "far"]


def test_a_carrier_takes_no_more_than_its_basket_does() -> None:
    world = street(3, manipulator(), carrier(basket=2))
    two = joined(by_carrier(world, 1, "far"), by_carrier(world, 2, "far"), world)
    assert two is not None
    assert joined(two.sequence, by_carrier(world, 3, "far"), world) is None
    roomy = street(3, manipulator(), carrier(basket=3))
    assert joined(two.sequence, by_carrier(roomy, 3, "far"), roomy) is not None


def test_what_stays_in_a_basket_is_not_driven_on() -> None:
    world = street(2, manipulator(), carrier())
    assert joined(by_carrier(world, 1, "middle"), by_carrier(world, 2, "far"), world) is None


def test_a_joint_trip_is_one_carrier_and_hands_that_may_be_anybody() -> None:
    world = street(2, manipulator(), manipulator("hsr_2"), carrier())
    made = joined(by_carrier(world, 1, "far"), by_carrier(world, 2, "far"), world)
    assert made is not None
    tasks, pins = deordered([made.sequence], world=world)
    assert not pins
    assert sum(task.args.get("to") == "far" for task in tasks) == 1
    loads = [task for task in tasks if task.skill == "place_on_robot"]
    assert len({task.args["carrier"] for task in loads}) == 1
    assert len({task.actor for task in loads}) == 2
    assert {task.goal for task in loads} == {"g1", "g2"}
    plan = Plan(
        plan="p",
        goals=("g1", "g2"),
        conditions=(*to(1, "far").conditions, *to(2, "far").conditions),
        tasks=tasks,
    )
    assert isinstance(check_plan(plan, world), CheckedPlan)
    # One carrier would drive to the far end instead of two.
    assert made.saved_s == pytest.approx(world.travel_s("locobot", "near", "far"))


@pytest.mark.parametrize("strategy", [PER_GOAL, MONOLITHIC])
def test_only_a_plan_for_all_goals_together_joins_trips(strategy: str) -> None:
    world = street(2, manipulator(), carrier())
    plan = planned(world, to(1, "far"), to(2, "far"), strategy=strategy)
    assert all(task.goal in ("g1", "g2") for task in plan.tasks)


def test_the_way_to_where_a_robot_stands_takes_no_time() -> None:
    world = street(1, manipulator())
    navigate = SKILLS["navigate"]
    here = navigate.ground({"robot": "hsr", "to": "near"})
    there = navigate.ground({"robot": "hsr", "to": "far"})
    assert world.duration_s(here, "near", "hsr") == 0.0
    assert world.duration_s(there, "near", "hsr") > navigate.duration_s


def test_a_schedule_counts_no_way_to_where_a_robot_stands() -> None:
    world = street(1, manipulator())
    made = SymbolicPlanner().plan(PlanningProblem("p", (to(1, "far"),), world))
    assert isinstance(made, CheckedPlan), made
    found = MakespanAllocator(exact=False, clock=StepClock()).allocate(made)
    assert isinstance(found, Allocated), found
    work_s = sum(world.work_s("hsr", SKILLS[name]) for name in ("pick", "navigate", "place"))
    way_s = world.travel_s("hsr", "near", "far")
    assert found.schedule.makespan_s == pytest.approx(work_s + way_s)
