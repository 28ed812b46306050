"""The makespan allocator on household plans, and its core on shops with known answers."""

from __future__ import annotations

import time

import pytest
from msgspec.structs import replace

from benchmarks.allocation.shops import random_shop
from fleet.allocators.base import Allocated, NotAllocated
from fleet.allocators.makespan import MakespanAllocator
from fleet.allocators.min_max_load import MinMaxLoadAllocator, TieBreak
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel
from fleet.jobshop.cpsat import CpSat, installed
from fleet.jobshop.instance import Instance
from fleet.jobshop.list_scheduling import list_schedule
from fleet.jobshop.portfolio import solve
from fleet.jobshop.problem import BadShop, Block, Machine, Operation, Shop
from fleet.jobshop.rescheduling import reschedule, without_machines
from fleet.jobshop.time_budget import StepClock, TimeBudget
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from fleet.scheduling.plan_shop import AllocationContext
from keyexpr_schema.ids import actor_arg, bound
from keyexpr_schema.payloads.plans import Plan, Task
from tests.support.household import bring, carrier, checked, home, manipulator

QUICK = MakespanAllocator(deadline_s=0.2, exact=False, clock=StepClock())

NEVER_S = 600.0
"""A search that has not ended by itself by then never will: it takes seconds."""


def steps(seconds: float) -> TimeBudget:
    """The same number of iterations on every machine."""
    return TimeBudget(seconds, StepClock())


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
    assert found.lower_bound_s is not None and found.gap is not None
    assert found.lower_bound_s <= found.schedule.makespan_s + 1e-6
    assert 0.0 <= found.gap < 1.0
    assert found.notes
    assert balanced.lower_bound_s is None and balanced.gap is None


def test_tasks_start_as_soon_as_those_before_them_end() -> None:
    """With the way from where the robot is by then; robots take actors in the schedule's order."""
    world = team()
    plan = planned(world, (1, "hallway"), (2, "living_room"), (3, "hallway"))
    found = allocated(QUICK, plan, world)
    schedule = found.schedule
    extra = schedule.extra_after
    graph = TaskGraph({t.task: {*t.after, *extra.get(t.task, ())} for t in plan.tasks})
    tasks = {task.task: task for task in plan.tasks}
    where = {robot: world.value("at", robot) for robot in world.team}
    for task in graph.order:
        args = {name: bound(arg, found.allocation) for name, arg in tasks[task].args.items()}
        action = world.skills[tasks[task].skill].ground(args)
        befores = graph.predecessors[task]
        start_s = max((schedule.end_s[before] for before in befores), default=0.0)
        end_s = start_s + world.duration_s(action, where[action.actor], action.actor)
        assert (schedule.start_s[task], schedule.end_s[task]) == pytest.approx((start_s, end_s))
        for key, value in action.after:
            if key == ("at", action.actor):
                where[action.actor] = value


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


@pytest.mark.skipif(not installed(), reason="OR-Tools is an extra: cp-sat")
@pytest.mark.parametrize("seed", range(3))
def test_eight_tasks_with_meetings_are_proven_optimal(seed: int) -> None:
    found = solve(random_shop(8, 3, travel=True, meetings=0.5, seed=seed), TimeBudget(NEVER_S))
    assert found is not None
    assert found.gap < 1e-4


def test_without_or_tools_the_rest_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fleet.jobshop.portfolio.installed", lambda: False)
    found = solve(random_shop(30, 4), steps(0.1))
    assert found is not None
    assert not any("CP-SAT" in note for note in found.notes)


@pytest.mark.skipif(not installed(), reason="OR-Tools is an extra: cp-sat")
def test_cp_sat_is_ended_in_the_middle() -> None:
    ready = Instance(random_shop(40, 4))
    hint = list_schedule(ready)
    assert hint is not None
    run = CpSat(ready, hint, 0.0, time.time() + 60.0, 0)
    assert not run.ended
    run.close()
    assert run.ended


def test_a_lost_robot_moves_little() -> None:
    """Its own blocks must move; a whole new schedule would move nearly all.

    That is so where a new one is not shorter by more than `WITHIN`, as in this shop.
    """
    shop = random_shop(300, 20, travel=False, meetings=0.0, seed=3)
    before = solve(shop, steps(0.3), exact=False)
    assert before is not None
    left = without_machines(shop, frozenset({2}))
    found = reschedule(left, before.machine_of, before.order, steps(1.0))
    afresh = list_schedule(Instance(left))
    assert found is not None and afresh is not None
    orphans = before.machine_of.count(2)
    moved_afresh = sum(a != b for a, b in zip(afresh.machine_of, before.machine_of, strict=True))
    assert orphans <= len(found.moved) < moved_afresh / 2
    assert found.schedule.makespan_s <= found.best_makespan_s * 1.02 + 1e-6


def test_work_under_way_stays_and_comes_first() -> None:
    shop = random_shop(60, 6, seed=2)
    before = solve(shop, steps(0.1), exact=False)
    assert before is not None
    first = {before.machine_of[b]: b for b in reversed(before.order)}
    frozen = frozenset(
        block
        for machine, block in first.items()
        if machine != 1 and len(shop.blocks[block].operations) == 1
    )
    left = without_machines(shop, frozenset({1}))
    found = reschedule(left, before.machine_of, before.order, steps(0.3), frozen)
    assert found is not None and frozen
    for block in frozen:
        machine = before.machine_of[block]
        assert found.schedule.machine_of[block] == machine
        mine = [b for b in found.schedule.order if found.schedule.machine_of[b] == machine]
        assert mine[0] == block


def test_a_shop_that_contradicts_itself_is_refused() -> None:
    one = Operation((0,), (1.0,))
    with pytest.raises(BadShop, match="no machine"):
        Shop((one,), (Block((0,), ()),), (Machine(),))
    with pytest.raises(BadShop, match="does not exist"):
        Shop((one,), (Block((0,), (3,)),), (Machine(),))
    with pytest.raises(BadShop, match="circle"):
        Instance(
            Shop(
                (Operation((0,), (1.0,), after=(1,)), Operation((1,), (1.0,), after=(0,))),
                (Block((0,), (0,)), Block((1,), (0,))),
                (Machine(),),
            )
        )
    with pytest.raises(BadShop, match="no machine that is left"):
        without_machines(Shop((one,), (Block((0,), (0,)),), (Machine(),)), frozenset({0}))
