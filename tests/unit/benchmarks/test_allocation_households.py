"""The households and alternatives that allocation is measured with."""

from __future__ import annotations

import pytest

from benchmarks.allocation.baselines import big_m, in_turn, makespan_s, nearest, papers_milp
from benchmarks.allocation.bench_household import compare
from benchmarks.allocation.household import (
    CLOCKS,
    REAL,
    STRATEGIES,
    WAYS,
    household,
    plan_of,
    scenarios,
    world_of,
)
from benchmarks.allocation.shops import random_shop
from fleet.allocators.base import Allocated
from fleet.allocators.makespan import MakespanAllocator
from fleet.allocators.round_robin import RoundRobinAllocator
from fleet.core.checker.plan_checker import check_plan
from fleet.jobshop.portfolio import solve
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.time_budget import StepClock, TimeBudget
from tests.support.household import checked


@pytest.mark.parametrize("scenario", scenarios())
@pytest.mark.parametrize("strategy", STRATEGIES)
def test_every_household_is_a_plan_that_somebody_can_carry_out(
    scenario: str, strategy: str
) -> None:
    for seed in range(10):
        home = household(scenario, seed)
        assert home == household(scenario, seed)
        plan = plan_of(home, strategy)
        for clock in CLOCKS:
            assert check_plan(plan, world_of(home, clock)).violations == ()


def test_seeds_differ_in_durations_and_graphs() -> None:
    homes = [household("3 robots, 5 goals", seed) for seed in range(10)]
    assert len({home.chores for home in homes}) == 10
    assert len({tuple(chore.name for chore in home.chores) for home in homes}) > 5
    assert len({tuple(map(str, home.robots)) for home in homes}) > 5


def test_goals_planned_together_do_once_what_two_need() -> None:
    home = household("5 robots, 10 goals", 0)
    together, apart = plan_of(home, "big-dag"), plan_of(home, "per-goal")
    assert len(together.tasks) < len(apart.tasks)
    assert sum(task.skill.endswith(".find_phone") for task in together.tasks) == 1
    assert sum(task.skill.endswith(".find_phone") for task in apart.tasks) == 2
    goal_of = {task.task: task.goal for task in apart.tasks}
    assert all(goal_of[b] == task.goal for task in apart.tasks for b in task.after)


def test_one_list_of_goals_goes_from_goal_to_goal() -> None:
    home = household("3 robots, 5 goals", 1)
    plan = plan_of(home, "monolithic")
    allocator = MakespanAllocator(0.1, exact=False, clock=StepClock())
    made = allocator.allocate(checked(plan, world_of(home, REAL)))
    assert isinstance(made, Allocated)
    start_s, end_s = made.schedule.start_s, made.schedule.end_s
    for one, other in zip(home.goals, home.goals[1:], strict=False):
        last = max(end_s[task.task] for task in plan.tasks if task.goal == one)
        assert min(start_s[task.task] for task in plan.tasks if task.goal == other) >= last - 1e-9


def test_idle_time_cannot_be_less_than_at_the_bound() -> None:
    allocators = (MakespanAllocator(0.1, exact=False, clock=StepClock()), RoundRobinAllocator())
    for run in compare("3 robots, 5 goals", 2, "per-goal", REAL, allocators):
        assert 0.0 <= run.least_idle <= run.fleet_idle < 1.0
        assert run.bound_s <= run.makespan_s + 1e-6
    with pytest.raises(ValueError, match="no strategy"):
        plan_of(household("3 robots, 5 goals", 2), "none")
    assert world_of(household("3 robots, 5 goals", 2), WAYS).travel_s(
        "moma_1", "kitchen", "pantry"
    ) == pytest.approx(3 / 0.5)


@pytest.mark.parametrize("travel", [False, True])
def test_alternatives_are_schedules_and_none_is_below_the_bound(travel: bool) -> None:
    shop = random_shop(12, 3, travel, 0.3 if travel else 0.0)
    ready = Instance(shop)
    best = solve(shop, TimeBudget(0.5, StepClock()), exact=False)
    assert best is not None
    for choose in (nearest, in_turn, papers_milp):
        machine_of = choose(ready)
        assert machine_of is not None
        assert all(m in shop.blocks[b].machines for b, m in enumerate(machine_of))
        reached_s = makespan_s(shop, machine_of)
        assert reached_s is not None and reached_s >= best.lower_bound_s - 1e-6
    exact = big_m(ready)
    assert (exact is None) == travel
    if exact is not None:
        assert exact >= best.lower_bound_s - 1e-3
