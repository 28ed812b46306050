"""The paper's allocation: a mixed-integer program that keeps the busiest robot's load small."""

from __future__ import annotations

import logging

from fleet.allocators.balanced import load_problem
from fleet.allocators.base import AllocationProblem, Allocator, Assignment, NotAllocated
from fleet.allocators.load_balancing import Unbalanced, balance
from fleet.allocators.min_max_load import Bound, min_max_load
from fleet.allocators.reasons import not_apart
from fleet.allocators.round_robin import in_turn
from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.plans import Violation

log = logging.getLogger(__name__)

TIME_LIMIT_S = 20.0
"""Wall time given to the solver, s; the best answer so far is taken: every answer is checked."""
MOST_VARIABLES = 100_000
"""Pairs of an actor and a robot that are put to the solver: so many take 7 s, travel included."""


class MilpAllocator(Allocator):
    """Minimise the largest number of tasks on a robot (RobotFleet, Gupta et al.), on actors.

    Every actor is one robot that is able to be it; actors that meet in one task are different
    robots. Ties go to the least total travel. The solver begins with the sharing that `balanced`
    finds and with its bound: identical robots would keep it busy for ever otherwise.

    With `fallback_round_robin` the paper's round-robin takes over where the solver finds nothing,
    and a note in the answer says so. It still gives no robot what it cannot do.
    """

    name = "milp"
    name_with_fallback = "milp-or-round-robin"

    def __init__(
        self,
        fallback_round_robin: bool = False,
        time_limit_s: float = TIME_LIMIT_S,
        solver: str | None = None,
    ) -> None:
        self._fallback = fallback_round_robin
        if fallback_round_robin:
            self.name = self.name_with_fallback
        self._time_limit_s = time_limit_s
        self._solver = solver

    def _assign(self, problem: AllocationProblem) -> dict[str, str] | Assignment | NotAllocated:
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
        if bound.robot and sum(map(len, problem.able.values())) > MOST_VARIABLES:
            note = (
                f"more than {MOST_VARIABLES} choices are too many for the solver: loads are "
                "balanced without it, and travel is not looked at"
            )
            return Assignment(bound.robot, notes=(note,))
        solved = min_max_load(
            problem.able,
            problem.load,
            problem.apart,
            bound,
            self._time_limit_s,
            approaches_s(problem),
            self._solver,
        )
        if solved.robot is None:
            told = not_apart(problem, (), solved.proven)
            return self._otherwise(problem, told)
        if solved.proven:
            return solved.robot
        note = (
            f"the busiest robot has {solved.top} tasks, and the solver has not proven in its time "
            "that it cannot have fewer"
        )
        return Assignment(solved.robot, notes=(note,))

    def _otherwise(
        self, problem: AllocationProblem, refused: NotAllocated
    ) -> Assignment | NotAllocated:
        if not self._fallback:
            return refused
        why = refused.violations[0].sentence
        made = in_turn(problem)
        if isinstance(made, NotAllocated):
            told = f"round-robin instead of the MILP finds none either: {why}"
            return NotAllocated((Violation(code="no-allocation", sentence=told),))
        note = f"allocated by round-robin and not by the MILP: {why}"
        log.warning(note)
        return Assignment(made, notes=(note,))


def approaches_s(problem: AllocationProblem) -> dict[tuple[str, str], float]:
    """By actor and able robot: its way from where it is to where the actor starts to work, s."""
    world = problem.world
    to: dict[str, str] = {}
    for task in problem.plan.tasks:
        action = problem.checked.actions[task.task]
        if action.skill.travel_to is not None:
            to.setdefault(task.actor, action.args[action.skill.travel_to])
    where = {robot: world.value(AT, robot) for robot in world.team} if to else {}
    return {
        (actor, robot): world.travel_s(robot, where[robot], to[actor]) if actor in to else 0.0
        for actor, robots in problem.able.items()
        for robot in robots
    }
