"""COHERENT's tasks (github.com/MrKeee/COHERENT), planned by us and carried out by the set's rules.

`python -m benchmarks.public.coherent --data FOLDER [--out docs/benchmarks] [--only env3]`, FOLDER
being a copy of that repository, or of its folder `env`. The set has no licence, so that nothing of
it is here. Each task's graph is made a world of ours (`graph_world`), planned with the strategy
`least-work`, allocated, and carried out step by step in a graph of its own (`graph_rules`), which
refuses what the set's robots may not do, and judges by the set's own goal.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from graphlib import TopologicalSorter
from itertools import repeat
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.public.errors import BadTaskFile, IllegalStep
from benchmarks.public.graph_rules import Situation, Step
from benchmarks.public.graph_world import goal_of, step_of, world_of
from benchmarks.public.scene_graph import Task, tasks_in
from benchmarks.tables import as_json, as_markdown, machine
from fleet.allocators.base import Allocated
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.base import LEAST_WORK, NoPlan, PlanningProblem
from fleet.service.composition import Composition, compose
from keyexpr_schema.ids import actor_in
from keyexpr_schema.payloads.plans import Plan

LIMIT_S = 60.0
"""Processor time for a plan: what the planner has of its 120 s by default."""
MOST_BY_REFERENCE = 2
"""By the set's rules more steps than so many times the reference are no success."""
HEAD = ("file", "tasks", "success", "steps", "reference", "planning, median", "planning, worst")


@dataclass(frozen=True)
class Result:
    """What came of a task: steps taken, if it succeeded, and why it did not; processor time [s]."""

    env: str
    task: int
    reference: int
    steps: int | None
    planning_s: float
    why: str = ""

    @property
    def name(self) -> str:
        """File and number."""
        return f"{self.env}-{self.task}"


def main() -> None:
    """Print the tables, and write the page."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--data", type=Path, required=True, help="a copy of the set")
    options.add_argument("--out", type=Path, help="folder to write the page into")
    options.add_argument("--only", default="", help="tasks whose names begin so, e.g. env0-1")
    options.add_argument(
        "--jobs", type=int, default=1, help="processes, each with a task at a time"
    )
    options.add_argument("--limit", type=float, default=LIMIT_S, help="processor time a plan, s")
    chosen = options.parse_args()
    console = Console(width=160)
    load = os.getloadavg()[0]
    told = f"{machine()}; commit {_commit()}; load average before it began: {load:.1f}."
    try:
        tasks = [task for task in tasks_in(chosen.data) if task.name.startswith(chosen.only)]
    except BadTaskFile as error:
        sys.exit(str(error))
    results = []
    with ProcessPoolExecutor(chosen.jobs) as processes:
        for result in processes.map(carried_out, tasks, repeat(chosen.limit)):
            results.append(result)
            outcome = result.why if result.steps is None else f"{result.steps} steps"
            told_of = f"{outcome} (reference: {result.reference}), {result.planning_s:.1f} s"
            console.print(f"{result.name}: {told_of}", highlight=False)
    rows = rows_of(results)
    table = Table(*HEAD, title=f"COHERENT; {told}")
    for row in rows:
        table.add_row(*row)
    console.print(table)
    if chosen.out is not None:
        _write(chosen.out, results, rows, told)


def carried_out(task: Task, limit_s: float) -> Result:
    """A task planned, and carried out in a graph of its own."""
    parts = compose()
    began_s = time.process_time()

    def result(steps: int | None, why: str = "") -> Result:
        return Result(task.env, task.number, task.reference_steps, steps, round(took_s, 3), why)

    steps = planned(task, parts, limit_s)
    took_s = time.process_time() - began_s
    situation = Situation.first(task)
    if isinstance(steps, str):
        return result(None, situation.never(task.goal) or steps)
    for step in steps:
        try:
            situation = situation.after(step)
        except IllegalStep as error:
            return result(None, str(error))
    if not situation.holds(task.goal):
        return result(None, "carried out, and the goal does not hold")
    if len(steps) > MOST_BY_REFERENCE * task.reference_steps:
        return result(None, f"{len(steps)} steps are more than twice the reference's")
    return result(len(steps))


def planned(task: Task, parts: Composition, limit_s: float) -> list[Step] | str:
    """The steps of a plan for a task, in the order in which they begin; or why there is none."""
    try:
        world = world_of(task)
    except BadTaskFile as error:
        return str(error)
    problem = PlanningProblem(
        plan="p",
        goals=(goal_of(task),),
        world=world,
        strategy=LEAST_WORK,
        budget=TimeBudget(limit_s, time.process_time),
    )
    made = parts.planners["symbolic"].plan(problem)
    if isinstance(made, NoPlan):
        return made.reason
    found = parts.allocators["makespan"].allocate(made)
    if not isinstance(found, Allocated):
        return found.violations[0].sentence
    return _in_order(task, world, made.plan, found)


def _in_order(task: Task, world: WorldModel, plan: Plan, found: Allocated) -> list[Step]:
    tasks = {row.task: row for row in plan.tasks}
    order = list(TopologicalSorter({name: row.after for name, row in tasks.items()}).static_order())
    order.sort(key=lambda name: found.schedule.start_s[name])
    steps = []
    for name in order:
        row = tasks[name]
        args = {
            parameter: value if (actor := actor_in(value)) is None else found.allocation[actor]
            for parameter, value in row.args.items()
        }
        steps.append(step_of(world.skills[row.skill].ground(args), task))
    return steps


def rows_of(results: Sequence[Result]) -> list[tuple[str, ...]]:
    """A row for each file, and one for all; steps of those that succeeded, beside the same tasks'
    reference steps."""
    envs = [*dict.fromkeys(row.env for row in results), "all"]
    rows: list[tuple[str, ...]] = []
    for env in envs:
        mine = [row for row in results if env in (row.env, "all")]
        done = [row for row in mine if row.steps is not None]
        spent = sorted(row.planning_s for row in mine)
        steps = sum(row.steps or 0 for row in done)
        reference = sum(row.reference for row in done)
        each = max(1, len(done))
        rows.append(
            (
                env,
                str(len(mine)),
                f"{len(done)}/{len(mine)}",
                f"{steps} ({steps / each:.2f} each)",
                f"{reference} ({reference / each:.2f} each)",
                f"{spent[len(spent) // 2]:.2f} s",
                f"{spent[-1]:.2f} s",
            )
        )
    return rows


def others(results: Sequence[Result]) -> list[tuple[str, ...]]:
    """The tasks that did not succeed, or not in as many steps as the reference says."""
    return [
        (row.name, "none" if row.steps is None else str(row.steps), str(row.reference), row.why)
        for row in results
        if row.steps != row.reference
    ]


def _commit() -> str:
    asked = ["git", "rev-parse", "--short", "HEAD"]
    found = subprocess.run(asked, capture_output=True, text=True, check=False)
    return found.stdout.strip() or "unknown"


def _write(
    folder: Path, results: Sequence[Result], rows: Sequence[tuple[str, ...]], told: str
) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    about = Path(__file__).with_name("coherent_page.md").read_text(encoding="utf-8")
    text = about.format(
        told=told,
        table=as_markdown(HEAD, rows),
        others=as_markdown(("task", "steps", "reference", "why"), others(results)),
    )
    folder.joinpath("coherent.md").write_text(text, encoding="utf-8")
    measured = {"machine": told, "results": [asdict(row) for row in results]}
    folder.joinpath("coherent.json").write_text(as_json(measured), encoding="utf-8")


if __name__ == "__main__":
    main()
