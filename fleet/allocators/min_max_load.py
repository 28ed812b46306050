"""The paper's mixed-integer program, on actors: least maximum load, then least travel.

Source: RobotFleet (Gupta et al.), its MILP allocation: binary `x[a, r]` says that robot `r` is
actor `a`; every actor is one robot among those able; the number of tasks on the busiest robot is
least. Added here: actors that must be apart, and, among the sharings with that maximum, the one
with the least travel. The two are solved one after the other: a weighted sum would make the
tie-break either outweigh a task or vanish in the solver's tolerance.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fleet.allocators.solver_run import Found, solve

Pair = tuple[str, str]
TRAVEL_GAP = 1e-3
"""Relative gap at which the tie-break stops: a second in a quarter of an hour of travel."""
TRAVEL_LIMIT_S = 2.0
"""Wall time for the tie-break at most, s."""
IMPROVE_LIMIT_S = 3.0
"""Wall time to better a sharing that is there already, s at most. If the solver gets anywhere with
it, it has within a second; what is left is to prove that 20 alike robots cannot do with one less.
"""


@dataclass(frozen=True)
class Bound:
    """What is known before: a load that some robot must have, and a sharing to begin with."""

    least_top: int = 0
    robot: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class LeastLoad:
    """A robot for every actor and the greatest load; `None` if there is none or none was found.

    `proven`: no sharing has a lesser greatest load; or, with `robot` `None`, there is none.
    """

    robot: dict[str, str] | None
    top: int
    proven: bool


def min_max_load(
    able: Mapping[str, tuple[str, ...]],
    load: Mapping[str, int],
    apart: frozenset[Pair],
    bound: Bound,
    limit_s: float,
    travel_s: Mapping[Pair, float] | None = None,
    solver: str | None = None,
) -> LeastLoad:
    """Solve it within `limit_s` seconds of wall time, and much less if `bound` has a sharing.

    `travel_s[actor, robot]` is for the tie-break; without it there is none. With a `bound` that
    its sharing meets there is nothing left to minimise but travel.
    """
    end_s = time.monotonic() + limit_s
    top = max(_loads(bound.robot, load).values(), default=0)
    if bound.robot and top == bound.least_top:
        first = LeastLoad(dict(bound.robot), top, proven=True)
    else:
        first = _least_top(_Model(able, load, apart), bound, limit_s, solver)
    if first.robot is None or travel_s is None or not _robots_matter(able, travel_s):
        return first
    left_s = min(TRAVEL_LIMIT_S, end_s - time.monotonic())
    if left_s <= 0:
        return first
    model = _Model(able, load, apart)
    model.minimise_travel(travel_s, first.top)
    made = solve(model.problem, left_s, TRAVEL_GAP, model.start(first.robot), solver)
    if not made.values:
        return first
    return LeastLoad(model.robots(made.values), first.top, first.proven)


def _least_top(model: _Model, bound: Bound, limit_s: float, solver: str | None) -> LeastLoad:
    model.minimise_top(bound.least_top)
    start = None
    if bound.robot:
        start = model.start(bound.robot)
        start["top"] = float(max(_loads(bound.robot, model.load).values()))
        limit_s = min(limit_s, IMPROVE_LIMIT_S)
    made = solve(model.problem, limit_s, 0.0, start, solver)
    if made.values:
        robot = model.robots(made.values)
    elif bound.robot:
        robot = dict(bound.robot)
    else:
        return LeastLoad(None, 0, made.found is Found.INFEASIBLE)
    top = max(_loads(robot, model.load).values(), default=0)
    return LeastLoad(robot, top, made.found is Found.OPTIMAL or top == bound.least_top)


def _loads(robot: Mapping[str, str], load: Mapping[str, int]) -> dict[str, int]:
    loads: dict[str, int] = defaultdict(int)
    for actor, its in robot.items():
        loads[its] += load[actor]
    return loads


def _robots_matter(able: Mapping[str, tuple[str, ...]], travel_s: Mapping[Pair, float]) -> bool:
    """Whether travel differs between the robots that can be some actor."""
    return any(len({travel_s[a, robot] for robot in robots}) > 1 for a, robots in able.items())


class _Model:
    """Variables and constraints that both steps share."""

    def __init__(
        self,
        able: Mapping[str, tuple[str, ...]],
        load: Mapping[str, int],
        apart: frozenset[Pair],
    ) -> None:
        import pulp

        self.load = load
        self.problem: Any = pulp.LpProblem("allocation", pulp.LpMinimize)
        self.chosen: dict[Pair, Any] = {
            (actor, robot): self.problem.add_variable(f"x_{i}_{j}", cat="Binary")
            for i, (actor, robots) in enumerate(able.items())
            for j, robot in enumerate(robots)
        }
        self._sum = pulp.lpSum
        self._of: dict[str, list[str]] = defaultdict(list)
        for actor, robots in able.items():
            self.problem += self._sum(self.chosen[actor, robot] for robot in robots) == 1
            for robot in robots:
                self._of[robot].append(actor)
        for one, other in apart:
            for robot in able[one]:
                if (other, robot) in self.chosen:
                    self.problem += self.chosen[one, robot] + self.chosen[other, robot] <= 1

    def minimise_top(self, least: int) -> None:
        """The greatest number of tasks on a robot.

        Robots that can be the same actors are interchangeable: their loads come in order, which
        keeps the solver from looking at every permutation of them.
        """
        top = self.problem.add_variable("top", lowBound=least, cat="Integer")
        self.problem += top
        before: dict[tuple[str, ...], str] = {}
        for robot, actors in self._of.items():
            self.problem += self._tasks(robot) <= top
            same = before.get(key := tuple(actors))
            if same is not None:
                self.problem += self._tasks(same) >= self._tasks(robot)
            before[key] = robot

    def minimise_travel(self, travel_s: Mapping[Pair, float], top: int) -> None:
        """Seconds until every actor's robot is where it starts; no robot with more than `top`."""
        self.problem += self._sum(travel_s[k] * x for k, x in self.chosen.items())
        for robot in self._of:
            self.problem += self._tasks(robot) <= top

    def start(self, robot: Mapping[str, str]) -> dict[str, float]:
        """Values of the `x` for a sharing; among interchangeable robots the busiest comes first."""
        loads = _loads(robot, self.load)
        alike: dict[tuple[str, ...], list[str]] = defaultdict(list)
        for name, actors in self._of.items():
            alike[tuple(actors)].append(name)
        renamed: dict[str, str] = {}
        for members in alike.values():
            busiest = sorted(members, key=lambda name: -loads.get(name, 0))
            renamed.update(zip(busiest, members, strict=True))
        return {
            x.name: float(renamed[robot[actor]] == name) for (actor, name), x in self.chosen.items()
        }

    def robots(self, values: Mapping[str, float]) -> dict[str, str]:
        """The robot of every actor in a solution."""
        return {a: robot for (a, robot), x in self.chosen.items() if values[x.name] > 0.5}

    def _tasks(self, robot: str) -> Any:
        return self._sum(self.load[a] * self.chosen[a, robot] for a in self._of[robot])
