"""The makespan allocator on household plans."""

from __future__ import annotations

from math import inf

import pytest
from msgspec.structs import replace

from fleet.allocators.base import Allocated, NotAllocated
from fleet.allocators.makespan import MakespanAllocator
from fleet.allocators.min_max_load import MinMaxLoadAllocator, TieBreak
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import StepClock, TimeBudget
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from fleet.scheduling.allocation_context import AllocationContext
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.plans import Plan, Task
from tests.support.errand_plans import errand_plan
from tests.support.household import bring, carrier, checked, home, manipulator

QUICK = MakespanAllocator(deadline_s=0.2, exact=False, clock=StepClock())


def planned(world: WorldModel, *goals: tuple[int, str]) -> Plan:
    made = SymbolicPlanner().plan(
        PlanningProblem(plan="p", goals=tuple(bring(n, where) for n, where in goals), world=world)
    )
    assert not isinstance(made, NoPlan)
    return made.plan


def allocated(allocator: MakespanAllocator | MinMaxLoadAllocator, plan: Plan, world: WorldModel,
              told: AllocationContext | None = None) -> Allocated:  # fmt: skip
    found = allocator.allocate(checked(plan, world), told)
    assert isinstance(found, Allocated), found
    return found


def team() -> WorldModel:
    robots = (manipulator("arm_1"), manipulator("arm_2"), carrier("cart_1"), carrier("cart_2"))
    return home(robots, cups=4)


def test_it_is_no_longer_than_the_balanced_plan_and_says_how_far_from_optimal() -> None:
    world = team()
    plan = planned(world, (1, "hallway"), (2, "living_room"), (3, "hallway"), (4, "living_room"))
    balanced = allocated(MinMaxLoadAllocator(TieBreak.TRAVEL), plan, world)
    found = allocated(QUICK, plan, world)
    assert found.schedule.makespan_s <= balanced.schedule.makespan_s + 1e-6
    assert found.lower_bound_s is not None
    assert 0.0 < found.lower_bound_s <= found.schedule.makespan_s + 1e-6
    assert found.notes
    assert balanced.lower_bound_s is None


def test_the_same_question_has_the_same_answer_where_it_is_settled_at_once() -> None:
    world = team()
    plan = planned(world, (1, "hallway"))
    assert allocated(QUICK, plan, world) == allocated(QUICK, plan, world)


def test_a_robot_that_is_busy_gets_no_work_that_another_can_do_sooner() -> None:
    world = home((manipulator("arm_1"), manipulator("arm_2")), cups=1)
    plan = planned(world, (1, "hallway"))
    for busy, free in (("arm_1", "arm_2"), ("arm_2", "arm_1")):
        found = allocated(QUICK, plan, world, AllocationContext(ready_s={busy: 100.0}))
        assert set(found.allocation.values()) == {free}
    both = allocated(QUICK, plan, world, AllocationContext(ready_s={"arm_1": 100.0, "arm_2": 50.0}))
    assert min(both.schedule.start_s.values()) == pytest.approx(50.0)


def test_of_equal_makespans_the_urgent_goal_is_done_first() -> None:
    world = home((manipulator("arm_1"),), cups=3)
    plan = planned(world, (1, "hallway"), (2, "hallway"), (3, "hallway"))
    for urgent in ("g1", "g2", "g3"):
        found = allocated(QUICK, plan, world, AllocationContext(priority={urgent: 6}))
        ends = {
            goal: max(found.schedule.end_s[t.task] for t in plan.tasks if t.goal == goal)
            for goal in plan.goals
        }
        assert min(ends, key=ends.__getitem__) == urgent


def test_too_few_robots_is_a_sentence() -> None:
    """One robot has a hand and a basket, and cannot give anything to itself."""
    one = replace(manipulator(), capabilities={**manipulator().capabilities, "basket": 1.0})
    world = home((one,), cups=1)
    cup = {"object": "cup_1", "place": "kitchen"}
    calls = (
        ("go", "navigate", "a1", (), {"to": "kitchen"}),
        ("pick", "pick", "a1", ("go",), cup),
        ("come", "navigate", "a2", (), {"to": "kitchen"}),
        ("give", "place_on_robot", "a1", ("pick", "come"), {**cup, "carrier": actor_arg("a2")}),
    )
    tasks = tuple(
        Task(task=t, skill=skill, actor=a, after=after, args={"robot": actor_arg(a), **args})
        for t, skill, a, after, args in calls
    )
    plan = Plan(plan="p", goals=(), conditions=(), tasks=tasks)
    found = QUICK.allocate(checked(plan, world))
    assert isinstance(found, NotAllocated)
    assert found.violations[0].sentence


def test_the_search_ends_with_the_time_that_there_is_for_the_plan() -> None:
    plan, world = errand_plan(goals=30, robots=3)
    steps = []
    for left_s in (0.0, 40.0, inf):
        clock = StepClock(1.0)
        context = AllocationContext(limit=TimeBudget(left_s, StepClock(0.0)))
        allocated(MakespanAllocator(100.0, exact=False, clock=clock), plan, world, context)
        steps.append(clock())
    assert steps[0] < steps[1] < steps[2]
