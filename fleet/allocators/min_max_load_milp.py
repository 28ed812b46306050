"""The paper's mixed-integer program, on actors: least maximum load, then least travel.

Source: RobotFleet (Gupta et al.), its MILP allocation: binary `x[a, r]` says that robot `r` is
actor `a`; every actor is one robot among those able; the number of tasks on the busiest robot is
least. Added here: actors that must be apart, and, among the assignments with that maximum, the one
with the least travel. The two are solved one after the other: a weighted sum would make the
tie-break either outweigh a task or vanish in the solver's tolerance.

The program is a PuLP model; the HiGHS in scipy solves it (docs/decisions/0009).
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

Pair = tuple[str, str]


@dataclass(frozen=True)
class Solution:
    """The variables' values by name; none if no solution was found.

    `proven`: no solution is better than this one, to the gap allowed, or there is none at all;
    else time ran out.
    """

    values: Mapping[str, float]
    proven: bool


class MinMaxLoadProgram:
    """The program: `able` lists each actor's robots, `load` counts its tasks.

    Pairs `apart` are different robots. `model` is a `pulp.LpProblem`, complete once one of
    `minimise_max_load` and `minimise_travel` was called.
    """

    def __init__(
        self,
        able: Mapping[str, tuple[str, ...]],
        load: Mapping[str, int],
        apart: frozenset[Pair] = frozenset(),
    ) -> None:
        import pulp

        self.model: Any = pulp.LpProblem("allocation", pulp.LpMinimize)
        self._sum = pulp.LpAffineExpression
        self._load = load
        self._x: dict[Pair, Any] = {
            (actor, robot): self.model.add_variable(f"x_{i}_{j}", cat="Binary")
            for i, (actor, robots) in enumerate(able.items())
            for j, robot in enumerate(robots)
        }
        self._actors: dict[str, list[str]] = defaultdict(list)
        for actor, robots in able.items():
            self.model += self._sum([(self._x[actor, robot], 1) for robot in robots]) == 1
            for robot in robots:
                self._actors[robot].append(actor)
        for one, other in apart:
            for robot in set(able[one]).intersection(able[other]):
                self.model += self._x[one, robot] + self._x[other, robot] <= 1

    def minimise_max_load(self, lower: int = 0, upper: int | None = None) -> None:
        """The number of tasks on the busiest robot, from `lower` to `upper`.

        Robots that can be the same actors are interchangeable: their loads come in order, which
        keeps the solver from looking at every permutation of them.
        """
        most = self.model.add_variable("max_load", lowBound=lower, upBound=upper, cat="Integer")
        self.model += most
        before: dict[tuple[str, ...], str] = {}
        for robot, actors in self._actors.items():
            self.model += self._tasks(robot) <= most
            alike = before.get(key := tuple(actors))
            if alike is not None:
                self.model += self._tasks(alike) >= self._tasks(robot)
            before[key] = robot

    def minimise_travel(self, travel_s: Mapping[Pair, float], max_load: int) -> None:
        """Seconds until every actor's robot is where it starts; no robot with more tasks."""
        self.model += self._sum([(x, travel_s[pair]) for pair, x in self._x.items()])
        for robot in self._actors:
            self.model += self._tasks(robot) <= max_load

    def robots(self, values: Mapping[str, float]) -> dict[str, str]:
        """The robot of every actor in a solution."""
        return {actor: robot for (actor, robot), x in self._x.items() if values[x.name] > 0.5}

    def _tasks(self, robot: str) -> Any:
        return self._sum(
            [(self._x[actor, robot], self._load[actor]) for actor in self._actors[robot]]
        )


def max_load(robots: Mapping[str, str], load: Mapping[str, int]) -> int:
    """The number of tasks on the busiest robot; 0 without actors."""
    tasks: dict[str, int] = defaultdict(int)
    for actor, robot in robots.items():
        tasks[robot] += load[actor]
    return max(tasks.values(), default=0)


def solve(model: Any, limit_s: float, gap: float = 0.0) -> Solution:
    """Solve a `pulp.LpProblem` that minimises, to a relative `gap`, within `limit_s` of wall time.

    HiGHS looks at its clock between steps: with 100,000 variables it may be two seconds late.
    """
    end_s = time.monotonic() + limit_s
    import numpy as np
    from scipy.optimize import Bounds, LinearConstraint, milp
    from scipy.sparse import csr_array

    variables = model.variables()
    number = {variable: i for i, variable in enumerate(variables)}
    cost = np.zeros(len(variables))
    for variable, factor in model.objective.items():
        cost[number[variable]] = factor
    rows = model.constraints()
    columns = [number[variable] for row in rows for variable in row]
    factors = [factor for row in rows for factor in row.values()]
    starts = np.cumsum([0, *map(len, rows)])
    # `constant` is on the left-hand side; `sense` is -1 for at most, 0 for equal, 1 for at least.
    constraints = LinearConstraint(
        csr_array((factors, columns, starts), shape=(len(rows), len(variables))),
        [-inf if row.sense < 0 else -row.constant for row in rows],
        [inf if row.sense > 0 else -row.constant for row in rows],
    )
    found = milp(
        cost,
        integrality=[variable.cat == "Integer" for variable in variables],
        bounds=Bounds(
            [-inf if v.lowBound is None else v.lowBound for v in variables],
            [inf if v.upBound is None else v.upBound for v in variables],
        ),
        constraints=constraints,
        options={"time_limit": max(0.0, end_s - time.monotonic()), "mip_rel_gap": gap},
    )
    values = (
        {} if found.x is None else dict(zip(map(str, variables), found.x.tolist(), strict=True))
    )
    return Solution(values, proven=found.status in (0, 2))  # optimal, infeasible
