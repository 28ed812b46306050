"""Our own search beside classical planners, on the same household problems.

    python -m benchmarks.engines.run [--python VENV/bin/python] [--timeout 60]

The engines are not installed with this project. Make an environment for them and name its
interpreter: `pip install unified-planning up-fast-downward up-pyperplan up-aries`. An engine that
is not there is left out. Times are processor times of one run. A classical plan is a sequence, so
it is made into a DAG by the same causal links as ours, and scheduled with the same durations.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.bench_planner import goals_of, household
from benchmarks.engines import pddl
from fleet.allocators.base import Allocated, AllocationProblem, Allocator, Assignment
from fleet.core.checker.plan_checker import CheckedPlan, InvalidPlan, check_plan
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.planners.deordering import ActionSequence, deordered
from fleet.service.composition import Composition, compose
from keyexpr_schema.facts import AT, HOLDING, NOTHING
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.plans import Plan

SIZES = ((2, 2), (5, 3), (10, 5), (20, 10), (50, 20))
ENGINES = ("fast-downward", "pyperplan", "aries")
SOLVE = Path(__file__).with_name("solve.py")
OVERRUN_S = 15.0
"""Some engines ignore their time limit: they are ended so much later."""


@dataclass(frozen=True)
class Row:
    """What came of one planner on one problem; times and makespan in seconds."""

    size: tuple[int, int]
    planner: str
    outcome: str
    planning_s: float | None = None
    tasks: int | None = None
    makespan_s: float | None = None
    reallocated_s: float | None = None


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--python", default=sys.executable, help="the engines' interpreter")
    options.add_argument("--timeout", type=float, default=60.0, help="seconds for each problem")
    options.add_argument("--largest", type=int, default=50, help="leave out more goals than this")
    chosen = options.parse_args()
    parts = compose()
    console = Console(width=140)
    rows: list[Row] = []

    def announce(row: Row) -> None:
        """As it comes: the table is there only at the end."""
        rows.append(row)
        spent = row.outcome if row.planning_s is None else f"{row.planning_s:.2f} s"
        console.print(f"{row.size[0]} x {row.size[1]}  {row.planner}: {spent}", highlight=False)

    _own((1, 1), parts)  # what is loaded at the first use is no planning time
    given_up: set[str] = set()
    for size in (size for size in SIZES if size[0] <= chosen.largest):
        for row in _own(size, parts):
            announce(row)
        for engine in (engine for engine in ENGINES if engine not in given_up):
            announce(row := _engine(size, engine, parts, chosen.python, chosen.timeout))
            if row.planning_s is None:
                given_up.add(engine)
    console.print(_table(rows))


def _own(size: tuple[int, int], parts: Composition) -> list[Row]:
    world, goals = household(*size), goals_of(size[0])
    problem = PlanningProblem(plan="p", goals=goals, world=world, strategy="big-dag")
    began_s = time.process_time()
    planned = parts.planners["symbolic"].plan(problem)
    took_s = time.process_time() - began_s
    if isinstance(planned, NoPlan):
        return [Row(size, "own search", planned.reason)]
    made = _makespan_s(planned, parts.allocators["milp"])
    best = _makespan_s(planned, parts.allocators["makespan"])
    return [Row(size, "own search", "solved", took_s, len(planned.plan.tasks), made, best)]


@dataclass(frozen=True)
class SolvedOutside:
    """What came of an engine on a problem; `reallocated_s` once others may do the tasks."""

    outcome: str
    planning_s: float | None = None
    tasks: int | None = None
    makespan_s: float | None = None
    reallocated_s: float | None = None


def solved_outside(
    engine: str,
    world: WorldModel,
    goals: Sequence[Goal],
    parts: Composition,
    python: str,
    timeout_s: float,
) -> SolvedOutside:
    """A problem solved by an engine in another interpreter, its sequence made a DAG as ours are."""
    answer = _solve(engine, world, goals, python, timeout_s)
    if answer["status"] != "solved":
        return SolvedOutside(answer.get("why") or answer["status"])
    actions = pddl.actions(answer["steps"], world)
    own = _plan([ActionSequence("g", tuple(actions))], goals, together=True)
    bound = {task.actor: actions[i].actor for i, task in enumerate(own.tasks)}
    checked = check_plan(own, world)
    if isinstance(checked, InvalidPlan):
        return SolvedOutside(f"rejected: {checked.violations[0].sentence}")
    as_chosen = _Bound(bound).allocate(checked)
    cut = check_plan(_plan(_sequences(actions, world), goals, together=False), world)
    return SolvedOutside(
        "solved",
        answer["seconds"],
        len(actions),
        as_chosen.schedule.makespan_s if isinstance(as_chosen, Allocated) else None,
        _makespan_s(cut, parts.allocators["makespan"]) if isinstance(cut, CheckedPlan) else None,
    )


def _engine(
    size: tuple[int, int], engine: str, parts: Composition, python: str, timeout_s: float
) -> Row:
    world, goals = household(*size), goals_of(size[0])
    found = solved_outside(engine, world, goals, parts, python, timeout_s)
    return Row(
        size,
        engine,
        found.outcome,
        found.planning_s,
        found.tasks,
        found.makespan_s,
        found.reallocated_s,
    )


def _solve(
    engine: str, world: WorldModel, goals: Sequence[Goal], python: str, timeout_s: float
) -> dict:  # type: ignore[type-arg]
    with tempfile.TemporaryDirectory() as folder:
        domain, problem = Path(folder, "domain.pddl"), Path(folder, "problem.pddl")
        domain.write_text(pddl.domain(world))
        problem.write_text(pddl.problem(world, [c for goal in goals for c in goal.conditions]))
        command = [python, str(SOLVE), engine, str(domain), str(problem), str(timeout_s)]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=timeout_s + OVERRUN_S, check=False
            )
        except subprocess.TimeoutExpired:
            return {"status": f"no answer in {timeout_s:g} s"}
    for line in reversed(done.stdout.splitlines()):
        if line.startswith("{"):
            return json.loads(line)  # type: ignore[no-any-return]
    last = (done.stderr.strip().splitlines() or ["nothing"])[-1]
    return {"status": f"it ended with {done.returncode} and said {last[:80]}"}


class _Bound(Allocator):
    """Every actor is the robot that the sequence had."""

    name = "bound"

    def __init__(self, bound: dict[str, str]) -> None:
        self._bound = bound

    def _assign(self, problem: AllocationProblem) -> Assignment:
        return Assignment(self._bound)


def _sequences(actions: Sequence[Action], world: WorldModel) -> list[ActionSequence]:
    """A sequence cut where a robot's hand is empty again, so that others can take over; each part
    begins with the way to its first place, whoever does it.
    """
    open_: dict[str, list[Action]] = {}
    sequences: list[ActionSequence] = []
    for action in actions:
        mine = open_.setdefault(action.actor, [])
        for helper in action.participants[1:]:
            mine[:0] = open_.pop(helper, [])
        stands = {row.variable.subject: row.value for row in action.before if row.variable[0] == AT}
        moved = {before.actor for before in mine if before.skill.name == "navigate"}
        for robot in (robot for robot in action.participants if robot not in moved):
            if place := stands.get(robot):
                go = world.skills["navigate"].ground({"robot": robot, "to": str(place)})
                mine.append(go)
        mine.append(action)
        if any(row.variable.relation == HOLDING and row.value == NOTHING for row in action.after):
            sequences.append(ActionSequence("g", tuple(open_.pop(action.actor))))
    return sequences


def _plan(sequences: Sequence[ActionSequence], goals: Sequence[Goal], together: bool) -> Plan:
    tasks, pins = deordered(sequences, one_actor_each=together)
    conditions = tuple(c for goal in goals for c in goal.conditions)
    return Plan(plan="p", goals=("g",), conditions=conditions, tasks=tasks, pins=pins)


def _makespan_s(checked: CheckedPlan, allocator: Allocator) -> float | None:
    found = allocator.allocate(checked)
    return found.schedule.makespan_s if isinstance(found, Allocated) else None


def _table(rows: Sequence[Row]) -> Table:
    table = Table(
        "goals x robots",
        "planner",
        "planning, CPU",
        "tasks",
        "makespan",
        "makespan, allocated anew",
        title="planning engines; makespan: allocated by MILP, or with the engine's own robots; "
        "anew: by the makespan allocator",
    )
    for row in rows:
        solved = row.planning_s is not None
        table.add_row(
            f"{row.size[0]} x {row.size[1]}",
            row.planner,
            f"{row.planning_s:.2f} s" if row.planning_s is not None else row.outcome,
            str(row.tasks) if solved else "",
            *(_seconds(value) if solved else "" for value in (row.makespan_s, row.reallocated_s)),
        )
    return table


def _seconds(value: float | None) -> str:
    return "no schedule" if value is None else f"{value:.0f} s"


if __name__ == "__main__":
    main()
