"""The paper's allocation: a mixed-integer program that keeps the busiest robot's load small."""

from __future__ import annotations

import logging

from fleet.allocators.balanced import load_problem
from fleet.allocators.balancing import Unbalanced, balance
from fleet.allocators.base import AllocationProblem, Allocator, NotAllocated
from fleet.allocators.min_max_load import Bound, min_max_load
from fleet.allocators.reasons import not_apart
from fleet.allocators.round_robin import in_turn
from keyexpr_schema.plans import Violation

log = logging.getLogger(__name__)

TIME_LIMIT_S = 20.0
"""Wall time given to the solver, s; the best answer so far is taken: every answer is checked."""


class MilpAllocator(Allocator):
    """Minimise the largest number of tasks on a robot (RobotFleet, Gupta et al.), on actors.

    Every actor is one robot that is able to be it; actors that meet in one task are different
    robots. Ties go to the least total travel. The solver begins with the sharing that `balanced`
    finds and with its bound: identical robots would keep it busy for ever otherwise.

    With `fallback_round_robin` the paper's round-robin takes over where the solver finds nothing,
    and a warning says so. It still gives no robot what it cannot do.
    """

    name = "milp"

    def __init__(
        self,
        fallback_round_robin: bool = False,
        time_limit_s: float = TIME_LIMIT_S,
        solver: str | None = None,
    ) -> None:
        self._fallback = fallback_round_robin
        self._time_limit_s = time_limit_s
        self._solver = solver

    def _assign(self, problem: AllocationProblem) -> dict[str, str] | NotAllocated:
        made = balance(load_problem(problem))
        if isinstance(made, Unbalanced):
            if made.proven:
                actors = tuple(problem.able)
                return self._otherwise(
                    problem, not_apart(problem, [actors[a] for a in made.actors], proven=True)
                )
            bound = Bound()
        else:
            team = problem.world.team
            robots = (team[robot] for robot in made.robot)
            bound = Bound(made.least_top, dict(zip(problem.able, robots, strict=True)))
        travel_s = {
            (actor, robot): approach_s(problem, actor, robot)
            for actor, robots in problem.able.items()
            for robot in robots
        }
        solved = min_max_load(
            problem.able,
            problem.load,
            problem.apart,
            bound,
            self._time_limit_s,
            travel_s,
            self._solver,
        )
        if solved.robot is None:
            told = not_apart(problem, (), solved.proven)
            return self._otherwise(problem, told)
        if not solved.proven:
            log.info(
                "the solver's time of %g s is over: the busiest robot has %d tasks, "
                "and whether it could have fewer is not proven",
                self._time_limit_s,
                solved.top,
            )
        return solved.robot

    def _otherwise(
        self, problem: AllocationProblem, refused: NotAllocated
    ) -> dict[str, str] | NotAllocated:
        if not self._fallback:
            return refused
        why = refused.violations[0].sentence
        made = in_turn(problem)
        if isinstance(made, NotAllocated):
            told = f"round-robin instead of the MILP finds none either: {why}"
            return NotAllocated((Violation(code="no-allocation", sentence=told),))
        log.warning("allocated by round-robin and not by the MILP: %s", why)
        return made


def approach_s(problem: AllocationProblem, actor: str, robot: str) -> float:
    """Seconds for `robot` to get to where the actor starts to work."""
    for task in problem.plan.tasks:
        action = problem.checked.actions[task.task]
        if task.actor == actor and action.skill.travel_to is not None:
            where = problem.world.value("at", robot)
            return problem.world.travel_s(robot, where, action.args[action.skill.travel_to])
    return 0.0
