"""How long planning takes: symbolic planner, allocation, checker, by number of goals and robots.

Run from anywhere: `python benchmarks/bench_planner.py` (or `make bench`). Wall times, one run each
unless said; numbers are of this machine and of whatever else it was doing.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from statistics import median
from typing import TypeVar

from msgspec.structs import replace
from rich.console import Console
from rich.table import Table

from fleet.allocators.base import Allocated
from fleet.core.checker.plan_checker import check_plan
from fleet.core.model.world import WorldModel
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.service.composition import Composition, compose
from fleet.service.skill_models import load_all_skills
from keyexpr_schema.facts import AT, HOLDING, NOTHING
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object, Place

T = TypeVar("T")
SIZES = ((2, 2), (10, 5), (50, 20))
TARGETS_S = {(10, 5): 2.0, (50, 20): 20.0}
STRATEGIES = ("per-goal", "big-dag", "monolithic")
PLACES = 6
STEP_M = 4.0
CHECKED_TASKS = 1000
REPEATS = 5


def main() -> None:
    """Print the tables."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--largest", type=int, default=50, help="leave out more goals than this")
    largest = options.parse_args().largest
    parts = compose()
    console = Console(width=140)
    _planned((1, 1), "big-dag", parts)  # what is loaded at the first use is no planning time
    table = Table(
        "goals x robots",
        "strategy",
        "planner",
        "planner + MILP",
        "target",
        "tasks",
        "predicted makespan",
        "beside big-dag: time, makespan",
        title="symbolic planner, then allocation by MILP",
    )
    for size in SIZES:
        if size[0] > largest:
            continue
        rows = {s: _planned(size, s, parts) for s in STRATEGIES}
        base = rows["big-dag"]
        for strategy, (planning_s, both_s, tasks, makespan_s) in rows.items():
            target_s = TARGETS_S.get(size)
            table.add_row(
                f"{size[0]} x {size[1]}",
                strategy,
                f"{planning_s:.3f} s",
                f"{both_s:.3f} s",
                "" if target_s is None else f"{target_s:g} s: {_met(both_s, target_s)}",
                str(tasks),
                f"{makespan_s:.0f} s",
                f"{both_s / base[1]:.2f}, {makespan_s / base[3]:.2f}",
            )
    console.print(table)
    console.print(_checker_table())


def _met(seconds: float, target_s: float) -> str:
    return "met" if seconds <= target_s else "missed"


def household(goals: int, robots: int) -> WorldModel:
    """A row of rooms, a cup for every goal in some room, half the robots with hands, half with
    baskets.
    """
    places = tuple(
        Place(
            place=f"room_{i}",
            label=f"room {i}",
            travel_m={f"room_{j}": STEP_M * abs(i - j) for j in range(PLACES) if j != i},
        )
        for i in range(PLACES)
    )
    cups = tuple(
        Object(object=f"cup_{i}", kind="cup", label=f"cup {i}", ordinal=i + 1, mass_kg=0.15)
        for i in range(goals)
    )
    specs = tuple(_robot(i) for i in range(robots))
    facts = [_fact(cup.object, AT, f"room_{i % PLACES}") for i, cup in enumerate(cups)]
    facts += [_fact(s.robot, AT, f"room_{i * 2 % PLACES}") for i, s in enumerate(specs)]
    facts += [_fact(s.robot, HOLDING, NOTHING) for s in specs if "grip" in s.capabilities]
    return WorldModel.of(load_all_skills(), places, cups, specs, facts)


def _robot(number: int) -> RobotSpec:
    if number % 2 == 0:
        return RobotSpec(
            robot=f"arm_{number}",
            model="hsr",
            skills=("navigate", "search", "pick", "place", "place_on_robot"),
            capabilities={"drive": 0.6, "see": 4.0, "grip": 1.2, "reach": 1.0},
        )
    return RobotSpec(
        robot=f"cart_{number}",
        model="locobot",
        skills=("navigate", "search"),
        capabilities={"drive": 0.6, "see": 4.0, "basket": 2},
    )


def _fact(subject: str, relation: str, value: str) -> Fact:
    return Fact(subject=subject, relation=relation, value=value, source="benchmark")


def goals_of(count: int) -> tuple[Goal, ...]:
    return tuple(
        Goal(
            goal=f"g{i}",
            text=f"bring cup {i}",
            conditions=(
                Condition(
                    relation=AT,
                    subject=f"cup_{i}",
                    value=f"room_{(i + 1 + i % (PLACES - 1)) % PLACES}",
                ),
            ),
            ordinal=i,
        )
        for i in range(count)
    )


def _planned(
    size: tuple[int, int], strategy: str, parts: Composition
) -> tuple[float, float, int, float]:
    """Planning [s], planning and allocation [s], number of tasks, predicted makespan [s]."""
    goals, robots = size
    world = household(goals, robots)
    problem = PlanningProblem(plan="p", goals=goals_of(goals), world=world, strategy=strategy)
    made, planning_s = _timed(lambda: parts.planners["symbolic"].plan(problem))
    if isinstance(made, NoPlan):
        raise SystemExit(f"{goals} goals, {robots} robots, {strategy}: no plan: {made.reason}")
    found, allocating_s = _timed(lambda: parts.allocators["milp"].allocate(made))
    if not isinstance(found, Allocated):
        raise SystemExit(f"{goals} goals, {robots} robots, {strategy}: {found.violations[0]}")
    return planning_s, planning_s + allocating_s, len(made.plan.tasks), found.schedule.makespan_s


def _checker_table() -> Table:
    plan, world = big_plan(CHECKED_TASKS)
    table = Table("tasks", "edges", "check, median", "loosest order", title="plan checker")
    took_s = median(_timed(lambda: check_plan(plan, world))[1] for _ in range(REPEATS))
    checked = check_plan(plan, world)
    if checked.violations:
        raise SystemExit(f"the plan to be checked is wrong: {checked.violations[0].sentence}")
    edges = sum(len(task.after) for task in plan.tasks)
    table.add_row(str(len(plan.tasks)), str(edges), f"{took_s * 1e3:.0f} ms", "chains of four")
    chained = replace(
        plan,
        tasks=tuple(
            task if i == 0 else replace(task, after=(plan.tasks[i - 1].task,))
            for i, task in enumerate(plan.tasks)
        ),
    )
    took_s = median(_timed(lambda: check_plan(chained, world))[1] for _ in range(REPEATS))
    table.add_row(
        str(len(plan.tasks)), str(len(plan.tasks) - 1), f"{took_s * 1e3:.0f} ms", "a line"
    )
    return table


def big_plan(tasks: int) -> tuple[Plan, WorldModel]:
    """A valid plan of so many tasks: cups brought one by one, each by an actor of its own."""
    count = tasks // 4
    world = household(count, 20)
    rows: list[Task] = []
    for i in range(count):
        origin, target = f"room_{i % PLACES}", f"room_{(i + 1) % PLACES}"
        actor = {"robot": f"?a{i}"}
        steps: tuple[tuple[str, dict[str, str]], ...] = (
            ("navigate", {**actor, "to": origin}),
            ("pick", {**actor, "object": f"cup_{i}", "place": origin}),
            ("navigate", {**actor, "to": target}),
            ("place", {**actor, "object": f"cup_{i}", "place": target}),
        )
        for number, (skill, args) in enumerate(steps):
            name = f"t{4 * i + number}"
            after = (rows[-1].task,) if number else ()
            rows.append(Task(task=name, skill=skill, args=args, actor=f"a{i}", after=after))
    conditions = tuple(
        Condition(relation=AT, subject=f"cup_{i}", value=f"room_{(i + 1) % PLACES}")
        for i in range(count)
    )
    return Plan(plan="p", goals=(), conditions=conditions, tasks=tuple(rows)), world


def _timed(work: Callable[[], T]) -> tuple[T, float]:
    began_s = time.perf_counter()
    result = work()
    return result, time.perf_counter() - began_s


if __name__ == "__main__":
    main()
