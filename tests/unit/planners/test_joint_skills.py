"""Skills of several robots of one kind: two that carry a table, from skill file to allocation."""

from __future__ import annotations

from dataclasses import replace as changed

import pytest
from msgspec.structs import replace

from fleet.allocators import (
    Allocated,
    Allocator,
    MakespanAllocator,
    NotAllocated,
    RoundRobinAllocator,
)
from fleet.core.actors import actors_apart
from fleet.core.checker.plan_checker import CheckedPlan, check_allocation, check_plan
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.world import WorldModel
from fleet.planners import NoPlan
from fleet.planners.base import PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.ids import bare_name
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.world import Object
from tests.support.household import SKILLS, bring, checked, fact, home, manipulator

JOINT = skills_from_data(
    {
        "skills": {
            "carry_together": {
                "parameters": {
                    "robot": "robot",
                    "partner": "robot",
                    "object": "table",
                    "place": "place",
                    "to": "place",
                },
                "needs": {"robot": ["grip"], "partner": ["grip"]},
                "before": [
                    "at(robot) = place",
                    "at(partner) = place",
                    "at(object) = place",
                    "holding(robot) = nothing",
                    "holding(partner) = nothing",
                    "not any(x: movable, on(x) = object)",
                ],
                "after": ["at(object) = to", "at(robot) = to", "at(partner) = to"],
                "duration_s": 60,
                "travel_to": "to",
            }
        }
    },
    "joint.yaml",
)


def hall(robots: int, tables: int = 1) -> WorldModel:
    team = tuple(
        replace(manipulator(f"r{n}"), skills=(*manipulator().skills, *JOINT))
        for n in range(1, robots + 1)
    )
    names = [f"table_{n}" for n in range(1, tables + 1)]
    world = home(team, facts=tuple(fact(name, "at", "kitchen") for name in names))
    things = {
        name: Object(
            object=name, kind="table", label="table", movable=False, features=("supports",)
        )
        for name in names
    }
    return changed(world, skills={**SKILLS, **JOINT}, objects={**world.objects, **things})


def move(table: int) -> Goal:
    wanted = Condition(relation="at", subject=f"table_{table}", value="hallway")
    return Goal(goal=f"move_{table}", text="move it", conditions=(wanted,), ordinal=table)


def made(world: WorldModel, *goals: Goal, strategy: str = "big-dag") -> CheckedPlan | NoPlan:
    return SymbolicPlanner().plan(PlanningProblem("p", goals, world, strategy=strategy))


@pytest.mark.parametrize("strategy", ["big-dag", "per-goal", "monolithic"])
@pytest.mark.parametrize("allocator", [MakespanAllocator(), RoundRobinAllocator()])
def test_two_of_one_kind_carry_a_table_while_a_third_brings_a_cup(
    strategy: str, allocator: Allocator
) -> None:
    world = hall(3, tables=2)
    plan = made(world, move(1), move(2), bring(1, "living_room"), strategy=strategy)
    assert isinstance(plan, CheckedPlan), plan
    together = [task for task in plan.plan.tasks if task.skill == "carry_together"]
    assert len(together) == 2
    found = allocator.allocate(plan)
    assert isinstance(found, Allocated), found
    for task in together:
        pair = bare_name(task.args["robot"]), bare_name(task.args["partner"])
        assert tuple(sorted(pair)) in actors_apart(plan)
        assert len({found.allocation[actor] for actor in pair}) == 2


def test_one_robot_alone_cannot() -> None:
    assert isinstance(made(hall(1), move(1)), NoPlan)
    plan = made(hall(2), move(1))
    assert isinstance(plan, CheckedPlan)
    alone = changed(plan, world=hall(1), able=dict.fromkeys(plan.able, ("r1",)))
    assert isinstance(MakespanAllocator().allocate(alone), NotAllocated)


def carrying(partner: str = "?a2", *more: Task) -> Plan:
    tasks = [
        Task(
            task=f"go{n}",
            skill="navigate",
            args={"robot": f"?a{n}", "to": "kitchen"},
            actor=f"a{n}",
        )
        for n in (1, 2)
    ]
    carry = Task(
        task="carry",
        skill="carry_together",
        args={
            "robot": "?a1", "partner": partner, "object": "table_1", "place": "kitchen",
            "to": "hallway",
        },
        actor="a1",
        after=("go1", "go2"),
    )  # fmt: skip
    return Plan(plan="p", goals=(), conditions=(), tasks=(*tasks, carry, *more))


def test_the_checker_wants_both_there_and_two_of_them() -> None:
    world = hall(2)
    plan = checked(carrying(), world).plan
    assert not check_allocation(plan, world, {"a1": "r1", "a2": "r2"})
    codes = {v.code for v in check_allocation(plan, world, {"a1": "r1", "a2": "r1"})}
    assert codes == {"robot-in-two-places"}
    assert {v.code for v in check_plan(carrying("?a1"), world).violations} == {
        "robot-in-two-places"
    }
    tasks = tuple(replace(t, after=("go1",)) if t.task == "carry" else t for t in plan.tasks)
    early = check_plan(replace(plan, tasks=tasks), world).violations
    # The partner may still be on its way, and would have to be there by chance.
    assert {v.code for v in early} == {"robot-in-two-places", "no-robot"}


def test_the_partner_is_where_the_table_was_brought() -> None:
    after = Task(
        task="look",
        skill="search",
        args={"robot": "?a2", "place": "hallway"},
        actor="a2",
        after=("carry",),
    )
    assert not check_plan(carrying("?a2", after), hall(2)).violations
    elsewhere = replace(after, args={"robot": "?a2", "place": "kitchen"})
    found = check_plan(carrying("?a2", elsewhere), hall(2)).violations
    assert [(v.code, v.task) for v in found] == [("condition-undone", "look")]


def test_a_table_that_something_is_on_stays() -> None:
    laden = hall(2)
    laden = laden.with_facts({key: "table_1" for key in laden.facts if key == ("at", "cup_1")})
    found = check_plan(carrying(), laden).violations
    assert [v.sentence for v in found] == [
        "carry needs on(cup_1) != table_1, and that does not hold at the start"
    ]
