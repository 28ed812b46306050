"""Solvers side by side on the paper's mixed-integer program, under equal limits.

`PYTHONPATH=. python -m benchmarks.allocation.compare_solvers` from the top folder; `--kinds`,
`--sizes` and `--limit-s` choose. The problems are those of `bench_balanced`. `max load` is the
program left to itself; `travel` is the tie-break among allocations with the known maximum, from
which PuLP's solvers start (scipy takes no start). Every solver has the same PuLP model; HiGHS in
PuLP needs `highspy`, which is no dependency. Each row is a process of its own; the time includes
the import of the library and handing over the model, not its making. Wall times.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import time
from importlib.util import find_spec
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.allocation.bench_balanced import KINDS, problem_builder, program_of
from fleet.allocators.load_balancing.balance import balance
from fleet.allocators.load_balancing.problem import BalancedAssignment
from fleet.allocators.load_balancing.robot_sets import bits
from fleet.allocators.min_max_load import TRAVEL_GAP
from fleet.allocators.min_max_load_milp import max_load, solve

SOLVERS = ("scipy", "CBC", "HiGHS")
STEPS = ("max load", "travel")
SIDE_M, PLACES = 60.0, 12
SPEED_M_S = 1.0
GIVEN_UP = 20
"""A process that takes so many times its limit is ended."""


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--one", nargs=5, metavar=("KIND", "TASKS", "ROBOTS", "STEP", "SOLVER"))
    options.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    options.add_argument("--sizes", nargs="+", default=("100x20", "1000x100"))
    options.add_argument("--limit-s", type=float, default=10.0)
    given = options.parse_args()
    if given.one:
        kind, tasks, robots, step, solver = given.one
        row = measured(kind, int(tasks), int(robots), step, solver, given.limit_s)
        sys.stdout.write(json.dumps(row))
        return
    solvers = SOLVERS if find_spec("highspy") else SOLVERS[:2]
    table = Table("minimised", "tasks x robots", "robots", "start", *solvers)
    for step in STEPS:
        for size in given.sizes:
            for kind in given.kinds:
                rows = [_row(kind, size, step, solver, given.limit_s) for solver in solvers]
                table.add_row(step, size, kind, rows[0]["start"], *(row["result"] for row in rows))
    Console(width=150).print(table)


def _row(kind: str, size: str, step: str, solver: str, limit_s: float) -> dict[str, str]:
    command = [sys.executable, "-m", "benchmarks.allocation.compare_solvers"]
    command += ["--limit-s", str(limit_s), "--one", kind, *size.split("x"), step, solver]
    ran = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=GIVEN_UP * limit_s
    )
    if ran.returncode:
        return {"start": "", "result": f"ended with {ran.returncode}"}
    row: dict[str, str] = json.loads(ran.stdout.splitlines()[-1])
    return row


def measured(
    kind: str, tasks: int, robots: int, step: str, solver: str, limit_s: float
) -> dict[str, str]:
    """What was known before, and what the solver came to: time, value, whether proven."""
    problem = problem_builder(kind, tasks, robots, seed=1)()
    known = balance(problem)
    assert isinstance(known, BalancedAssignment)
    start = {str(actor): str(robot) for actor, robot in enumerate(known.robot)}
    program = program_of(problem)
    travel_s: dict[tuple[str, str], float] = {}
    begin: dict[str, float] = {}
    gap = 0.0
    if step == "max load":
        program.minimise_max_load()
    else:
        chance = random.Random(7)
        places = [(chance.uniform(0, SIDE_M), chance.uniform(0, SIDE_M)) for _ in range(PLACES)]
        at = [chance.choice(places) for _ in range(robots)]
        to = [chance.choice(places) for _ in range(tasks)]
        travel_s = {
            (str(a), str(r)): sum(abs(x - y) for x, y in zip(at[r], to[a], strict=True)) / SPEED_M_S
            for a, mask in enumerate(problem.able)
            for r in bits(mask)
        }
        program.minimise_travel(travel_s, max(known.loads))
        gap = TRAVEL_GAP
        begin = {
            f"x_{a}_{j}": float(robot == known.robot[a])
            for a, mask in enumerate(problem.able)
            for j, robot in enumerate(bits(mask))
        }
    began_s = time.perf_counter()
    if solver == "scipy":
        found = solve(program.model, limit_s, gap)
        values, proven = found.values, found.proven
    else:
        values, proven = _by_pulp(program.model, solver, limit_s, gap, begin)
    took_s = time.perf_counter() - began_s
    load = {str(actor): load for actor, load in enumerate(problem.load)}

    def value(chosen: dict[str, str]) -> str:
        if step == "max load":
            return str(max_load(chosen, load))
        return f"{sum(travel_s[pair] for pair in chosen.items()):.0f} s"

    outcome = value(program.robots(values)) if values else "nothing"
    return {
        "start": value(start),
        "result": f"{outcome} ({took_s:.1f} s{'' if proven else ', not proven'})",
    }


def _by_pulp(
    model: Any, solver: str, limit_s: float, gap: float, start: dict[str, float]
) -> tuple[dict[str, float], bool]:
    import pulp

    for variable in model.variables() if start else []:
        variable.setInitialValue(start[variable.name])
    options = {"msg": False, "timeLimit": limit_s, "gapRel": gap, "warmStart": bool(start)}
    cbc = pulp.PULP_CBC_CMD.pulp_cbc_path  # the one in PuLP's wheel
    model.solve(pulp.COIN_CMD(path=cbc, **options) if solver == "CBC" else pulp.HiGHS(**options))
    if solver == "HiGHS":  # PuLP says "Optimal" of what HiGHS found when its time was over
        highs = model.solverModel
        proven = str(highs.getModelStatus()).endswith("kOptimal")
        solved = highs.getInfo().primal_solution_status == 2
    else:
        proven = model.sol_status == pulp.LpSolutionOptimal
        solved = proven or model.sol_status == pulp.LpSolutionIntegerFeasible
    return {v.name: v.varValue for v in model.variables()} if solved else {}, proven


if __name__ == "__main__":
    main()
