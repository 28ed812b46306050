"""How long load balancing takes, and how much memory, beside the paper's MILP.

`python -m benchmarks.allocation.bench_balanced` from the top folder. Each row is a process of its
own, which builds the problem from what tasks need and robots have (`alike`, `types`, `different`:
a robot's capabilities) or from the list of robots that can do each task (`random`: about half of
them; `sparse`: two or three; `skewed`: up to three, the n-th robot with weight 1/n; `weighted`: as
random, actors of 1 to 7 tasks; `apart`: as random, every two actors different robots), solves it,
and gives every task its robot. The time is for all of that, the memory what the peak of the process
grew by over its input. Wall times, one run each; numbers are of this machine and of whatever else
it was doing.
"""

from __future__ import annotations

import argparse
import json
import random
import resource
import subprocess
import sys
import time
from collections.abc import Callable

from rich.console import Console
from rich.table import Table

from fleet.allocators.load_balancing.balance import balance
from fleet.allocators.load_balancing.problem import BalancedAssignment, LoadBalancingProblem
from fleet.allocators.load_balancing.robot_sets import bits, mask_of
from fleet.allocators.min_max_load_milp import MinMaxLoadProgram, solve

SIZES = ((100, 20), (1_000, 100), (10_000, 1_000))
KINDS = ("alike", "types", "different", "random", "sparse", "skewed", "weighted", "apart")
CAPABILITIES = 12
MILP_LIMIT_S = 20.0
MILP_TASKS = 100
"""With more tasks the program, left to itself, takes seconds to all of its time."""
TARGET_S, TARGET_MB = 1.0, 100.0


def main() -> None:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--one", nargs=3, metavar=("KIND", "TASKS", "ROBOTS"))
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--milp", action="store_true", help="the paper's MILP for small sizes too")
    given = options.parse_args()
    if given.one:
        kind, tasks, robots = given.one[0], int(given.one[1]), int(given.one[2])
        sys.stdout.write(json.dumps(measured(kind, tasks, robots, given.seed, given.milp)))
        return
    table = Table(
        "robots",
        "tasks x robots",
        "time",
        "memory",
        "loads: most, least",
        "bound",
        "proven",
        "MILP alone",
        title="evenest loads, build and answer included",
    )
    for kind in KINDS:
        for tasks, robots in SIZES:
            command = [sys.executable, "-m", "benchmarks.allocation.bench_balanced", "--one"]
            command += [kind, str(tasks), str(robots), "--seed", str(given.seed)]
            command += ["--milp"] if given.milp and tasks <= MILP_TASKS else []
            ran = subprocess.run(command, capture_output=True, text=True, check=True)
            row = json.loads(ran.stdout)
            met = row["s"] < TARGET_S and row["mb"] < TARGET_MB
            table.add_row(
                kind,
                f"{tasks} x {robots}",
                f"{row['s']:.3f} s" + ("" if met else " (missed)"),
                f"{row['mb']:.0f} MB",
                f"{row['most']}, {row['least']}",
                str(row["bound"]),
                "yes" if row["proven"] else "no",
                row.get("milp", ""),
            )
    Console(width=120).print(table)


def measured(kind: str, tasks: int, robots: int, seed: int, milp: bool) -> dict[str, object]:
    """Solve one problem: time [s], memory [MB], greatest and least load, and whether proven."""
    build = problem_builder(kind, tasks, robots, seed)
    before_kb, start = _peak_kb(), time.perf_counter()
    problem = build()
    made = balance(problem)
    took_s = time.perf_counter() - start
    assert isinstance(made, BalancedAssignment)
    row: dict[str, object] = {
        "s": took_s,
        "mb": (_peak_kb() - before_kb) / 1024,
        "most": made.loads[0],
        "least": made.loads[-1],
        "bound": made.lower_bound,
        "proven": made.optimal,
    }
    if milp:
        row["milp"] = _milp(problem)
    return row


def problem_builder(
    kind: str, tasks: int, robots: int, seed: int
) -> Callable[[], LoadBalancingProblem]:
    """What makes the problem from its input, which is drawn here."""
    chance = random.Random(seed)
    if kind in ("alike", "types", "different"):
        needs, has = _capabilities(kind, tasks, robots, chance)

        def from_capabilities() -> LoadBalancingProblem:
            able = {
                need: mask_of((r for r, held in enumerate(has) if need <= held), robots)
                for need in set(needs)
            }
            return LoadBalancingProblem([able[need] for need in needs], [1] * tasks, robots)

        return from_capabilities
    able = _able(kind, tasks, robots, chance)
    load = [chance.randint(1, 7) if kind == "weighted" else 1 for _ in range(tasks)]
    pairs = tasks // 2 if kind == "apart" else 0
    apart = frozenset((2 * n, 2 * n + 1) for n in range(pairs))
    return lambda: LoadBalancingProblem(
        [mask_of(found, robots) for found in able], load, robots, apart
    )


def _peak_kb() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _capabilities(
    kind: str, tasks: int, robots: int, chance: random.Random
) -> tuple[list[frozenset[int]], list[frozenset[int]]]:
    """What every task needs, and what every robot has; some robot can do each task."""
    all_of_them = range(CAPABILITIES)
    if kind == "alike":
        return [frozenset()] * tasks, [frozenset(all_of_them)] * robots
    if kind == "types":
        types = [frozenset(chance.sample(all_of_them, 6)) for _ in range(8)]
        has = [chance.choice(types) for _ in range(robots)]
    else:  # every robot has a serial number of its own, besides what it can do
        has = [
            frozenset(chance.sample(all_of_them, chance.randint(3, 9))) | {CAPABILITIES + r}
            for r in range(robots)
        ]
    needs: list[frozenset[int]] = []
    while len(needs) < tasks:
        robot = chance.choice(has)
        needs.append(frozenset(chance.sample(sorted(c for c in robot if c < CAPABILITIES), 2)))
    return needs, has


def _able(kind: str, tasks: int, robots: int, chance: random.Random) -> list[list[int]]:
    """The robots that can do each task."""
    if kind == "sparse":
        return [chance.sample(range(robots), chance.randint(2, 3)) for _ in range(tasks)]
    if kind == "skewed":
        weights = [1 / n for n in range(1, robots + 1)]
        return [sorted(set(chance.choices(range(robots), weights, k=3))) for _ in range(tasks)]
    return [list(bits(chance.getrandbits(robots) or 1)) for _ in range(tasks)]


def _milp(problem: LoadBalancingProblem) -> str:
    """The paper's program without any help: time, greatest load, whether proven."""
    start = time.perf_counter()
    program = program_of(problem)
    program.minimise_max_load()
    found = solve(program.model, MILP_LIMIT_S)
    most = f"{found.values['max_load']:.0f}" if found.values else "nothing"
    proven = "" if found.proven else " (not proven)"
    return f"{time.perf_counter() - start:.2f} s: {most}{proven}"


def program_of(problem: LoadBalancingProblem) -> MinMaxLoadProgram:
    """The paper's program; actors and robots are named by their numbers."""
    return MinMaxLoadProgram(
        {str(a): tuple(map(str, bits(mask))) for a, mask in enumerate(problem.able)},
        {str(a): load for a, load in enumerate(problem.load)},
        frozenset((str(one), str(other)) for one, other in problem.apart),
    )


if __name__ == "__main__":
    main()
