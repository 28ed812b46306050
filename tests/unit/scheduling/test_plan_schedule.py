"""Schedules of plans whose actors have robots: forward passes over the shop that the plan is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel
from fleet.planners.base import PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from fleet.scheduling.allocation_context import AllocationContext
from fleet.scheduling.plan_schedule import AllocatedPlan, PlanSchedule
from keyexpr_schema.ids import actor_arg, bound
from keyexpr_schema.payloads.plans import Plan, Task
from tests.support.household import bring, carrier, checked, fact, home, manipulator

CUP = {"object": "cup_1", "place": "kitchen"}


def bringing(world: WorldModel, *goals: tuple[int, str]) -> Plan:
    problem = PlanningProblem("p", tuple(bring(n, where) for n, where in goals), world)
    made = SymbolicPlanner().plan(problem)
    return made.plan


def test_tasks_start_as_soon_as_those_before_them_end() -> None:
    """With the travel from where the robot is by then, and robots in the schedule's order."""
    world = home((manipulator("arm_1"), manipulator("arm_2")), cups=4)
    plan = bringing(world, (1, "hallway"), (2, "living_room"), (3, "hallway"), (4, "hallway"))
    actors = plan.actors
    allocation = {actor: f"arm_{1 + i % 2}" for i, actor in enumerate(actors)}
    schedule = AllocatedPlan(checked(plan, world), allocation).valid_schedule()
    assert isinstance(schedule, PlanSchedule)
    assert sorted(sum(schedule.sequence.values(), ())) == sorted(actors)
    after = schedule.extra_after
    graph = TaskGraph({t.task: {*t.after, *after.get(t.task, ())} for t in plan.tasks})
    tasks = {task.task: task for task in plan.tasks}
    where = {robot: world.value("at", robot) for robot in world.team}
    for task in graph.order:
        args = {name: bound(arg, allocation) for name, arg in tasks[task].args.items()}
        action = world.skills[tasks[task].skill].ground(args)
        befores = graph.predecessors[task]
        start_s = max((schedule.end_s[before] for before in befores), default=0.0)
        end_s = start_s + world.duration_s(action, where[action.actor], action.actor)
        assert (schedule.start_s[task], schedule.end_s[task]) == pytest.approx((start_s, end_s))
        for key, value in action.after:
            if key == ("at", action.actor):
                where[action.actor] = value


def test_the_shortest_order_comes_first_and_no_order_twice() -> None:
    world = home((manipulator("arm_1"),), cups=3)
    plan = bringing(world, (1, "hallway"), (2, "living_room"), (3, "hallway"))
    allocated = AllocatedPlan(checked(plan, world), dict.fromkeys(plan.actors, "arm_1"))
    found = list(allocated.schedules())
    orders = [schedule.sequence["arm_1"] for schedule in found]
    assert len(set(orders)) == len(orders) == 6
    assert found[0].makespan_s == min(schedule.makespan_s for schedule in found)
    given = allocated.schedule(orders[-1])
    assert given == found[-1]


def test_a_robot_that_is_busy_begins_later_and_work_under_way_comes_first() -> None:
    world = home((manipulator("arm_1"),), cups=2)
    plan = bringing(world, (1, "hallway"), (2, "hallway"))
    for actor in plan.actors:
        context = AllocationContext(ready_s={"arm_1": 50.0}, under_way=frozenset({actor}))
        allocated = AllocatedPlan(
            checked(plan, world), dict.fromkeys(plan.actors, "arm_1"), context
        )
        first = next(allocated.schedules())
        assert min(first.start_s.values()) == 50.0
        assert first.sequence["arm_1"][0] == actor


def test_a_robot_that_the_plan_names_may_also_be_an_actor() -> None:
    """What the cart does by name is around what it does as an actor: as one block of its shop that
    would leave no order."""
    other = {"object": "cup_2", "place": "kitchen"}
    calls = (
        ("go", "navigate", "arm", (), {"to": "kitchen"}),
        ("pick", "pick", "arm", ("go",), CUP),
        ("give", "place_on_robot", "arm", ("pick",), {**CUP, "carrier": "cart_1"}),
        ("take", "pick", "arm", ("give",), other),
        ("turn", "navigate", "cart", ("give",), {"to": "kitchen"}),
        ("put", "place_on_robot", "arm", ("take", "turn"), {**other, "carrier": "cart_1"}),
    )
    there = fact("cart_1", "at", "kitchen")
    world = home((manipulator("arm_1"), carrier("cart_1")), cups=2, facts=(there,))
    tasks = tuple(
        Task(task=t, skill=skill, actor=a, after=after, args={"robot": actor_arg(a), **args})
        for t, skill, a, after, args in calls
    )
    plan = Plan(plan="p", goals=(), conditions=(), tasks=tasks, pins={"cart": "cart_1"})
    allocated = AllocatedPlan(checked(plan, world), {"arm": "arm_1", "cart": "cart_1"})
    schedule = allocated.valid_schedule()
    assert isinstance(schedule, PlanSchedule), schedule
    assert schedule.start_s["put"] >= schedule.end_s["turn"]


def test_a_robot_that_the_plan_names_and_that_is_away_takes_no_time() -> None:
    calls = (
        ("go", "navigate", (), {"to": "kitchen"}),
        ("pick", "pick", ("go",), CUP),
        ("give", "place_on_robot", ("pick",), {**CUP, "carrier": "cart_1"}),
    )
    there = fact("cart_1", "at", "kitchen")
    world = home((manipulator("arm_1"), carrier("cart_1")), facts=(there,))
    tasks = tuple(
        Task(task=t, skill=skill, actor="arm", after=after, args={"robot": "?arm", **args})
        for t, skill, after, args in calls
    )
    plan = Plan(plan="p", goals=(), conditions=(), tasks=tasks)
    away = replace(world, available=frozenset({"arm_1"}))
    found = AllocatedPlan(checked(plan, away), {"arm": "arm_1"}).valid_schedule()
    assert isinstance(found, PlanSchedule)
    assert found.sequence == {"arm_1": ("arm",)}
