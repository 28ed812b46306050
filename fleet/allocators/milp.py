"""The paper's allocation: a mixed-integer program that keeps the busiest robot's load small.

Many robots that are alike make the program symmetric, and a solver that has long found the best
answer goes on for ever to prove it. So what can be known without it is: a bound on the busiest
robot's load from below by counting, one from above by filling the least busy robot. Where they
meet, only the travel is left to be minimised, and that program is an easy one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from math import ceil

from fleet.allocators.base import AllocationProblem, Allocator, NotAllocated
from keyexpr_schema.plans import Violation

TIME_LIMIT_S = 5.0
"""Wall time given to the solver for each of two programs, s; the best answer so far is taken: every
answer is checked."""

Choice = tuple[str, str]
"""An actor, and a robot that is able to be it."""


class MilpAllocator(Allocator):
    """Minimise the largest number of tasks on a robot (RobotFleet, Gupta et al.), on actors.

    Variables: `x[a, r]` is 1 if robot `r` is actor `a`. Every actor is one robot that is able to
    be it; actors that meet in one task are different robots. Ties go to the least total travel.
    """

    name = "milp"

    def _assign(self, problem: AllocationProblem) -> dict[str, str] | NotAllocated:
        travel_s = {
            (actor, robot): _approach_s(problem, actor, robot)
            for actor, robots in problem.able.items()
            for robot in robots
        }
        filled = _filled(problem, travel_s)
        least = _least_top(problem)
        if filled is None or _top(problem, filled) > least:
            solved = _solved(problem, dict.fromkeys(travel_s, 0.0), least, None)
            filled = _better(problem, solved, filled)
        if filled is None:
            return NotAllocated(
                (
                    Violation(
                        code="no-allocation",
                        sentence="there are too few robots: actors that meet in one task must be "
                        "different robots, and no choice among those able makes them so",
                    ),
                )
            )
        top = _top(problem, filled)
        return _solved(problem, travel_s, top, top) or filled


def _solved(
    problem: AllocationProblem,
    travel_s: Mapping[Choice, float],
    least: int,
    most: int | None,
) -> dict[str, str] | None:
    """The program's answer, with the largest load from `least` to `most`; `None` if there is none.

    With a `most` the largest load is settled, and the total travel [s] is minimised.
    """
    import pulp

    model = pulp.LpProblem("allocation", pulp.LpMinimize)
    chosen = {
        (actor, robot): model.add_variable(f"x_{i}_{j}", cat="Binary")
        for i, (actor, robots) in enumerate(problem.able.items())
        for j, robot in enumerate(robots)
    }
    top = model.add_variable("top", lowBound=least, upBound=most)
    model += top + pulp.lpSum(travel_s[choice] * x for choice, x in chosen.items())
    for actor, robots in problem.able.items():
        model += pulp.lpSum(chosen[actor, robot] for robot in robots) == 1
    for robot in problem.world.team:
        mine = [(problem.load[a], x) for (a, r), x in chosen.items() if r == robot]
        if mine:
            model += pulp.lpSum(load * x for load, x in mine) <= top
    for one, other in problem.apart:
        for robot in problem.able[one]:
            if (other, robot) in chosen:
                model += chosen[one, robot] + chosen[other, robot] <= 1
    # The CBC that lies in PuLP's wheel; `pulp[cbc]` would add 600 MB for the same solver.
    cbc = pulp.PULP_CBC_CMD.pulp_cbc_path
    model.solve(pulp.COIN_CMD(path=cbc, msg=False, timeLimit=TIME_LIMIT_S))
    if model.sol_status not in (pulp.LpSolutionOptimal, pulp.LpSolutionIntegerFeasible):
        return None
    return {actor: robot for (actor, robot), x in chosen.items() if x.value() > 0.5}


def _filled(problem: AllocationProblem, travel_s: Mapping[Choice, float]) -> dict[str, str] | None:
    """Each actor to the least busy able robot, the choosiest and heaviest actors first; `None` if
    one is left over.
    """
    apart: dict[str, set[str]] = defaultdict(set)
    for one, other in problem.apart:
        apart[one].add(other)
        apart[other].add(one)
    load = dict.fromkeys(problem.world.team, 0)
    chosen: dict[str, str] = {}
    for actor in sorted(problem.able, key=lambda a: (len(problem.able[a]), -problem.load[a])):
        taken = {chosen.get(other) for other in apart[actor]}
        free = [robot for robot in problem.able[actor] if robot not in taken]
        if not free:
            return None
        robot = min(free, key=lambda r: (load[r], travel_s[actor, r]))
        chosen[actor] = robot
        load[robot] += problem.load[actor]
    return chosen


def _least_top(problem: AllocationProblem) -> int:
    """What the largest load is at least: the heaviest actor; and for every set of robots, what only
    they can do, shared out evenly among them.
    """
    sets = {frozenset(robots) for robots in problem.able.values()}
    sets.add(frozenset().union(*sets))
    evenly = [
        ceil(sum(problem.load[a] for a, able in problem.able.items() if robots >= set(able)) / n)
        for robots in sets
        if (n := len(robots))
    ]
    return max([*problem.load.values(), *evenly], default=0)


def _top(problem: AllocationProblem, chosen: Mapping[str, str]) -> int:
    load: dict[str, int] = defaultdict(int)
    for actor, robot in chosen.items():
        load[robot] += problem.load[actor]
    return max(load.values(), default=0)


def _better(
    problem: AllocationProblem, one: dict[str, str] | None, other: dict[str, str] | None
) -> dict[str, str] | None:
    if one is None or other is None:
        return one or other
    return min(one, other, key=lambda chosen: _top(problem, chosen))


def _approach_s(problem: AllocationProblem, actor: str, robot: str) -> float:
    """Seconds for `robot` to get to where the actor starts to work."""
    for task in problem.plan.tasks:
        action = problem.checked.actions[task.task]
        if task.actor == actor and action.skill.travel_to is not None:
            where = problem.world.value("at", robot)
            return problem.world.travel_s(robot, where, action.args[action.skill.travel_to])
    return 0.0
