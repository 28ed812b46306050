"""Least maximum load, as the paper's allocation; ties by the next loads, or by travel."""

from __future__ import annotations

import logging
import time
from enum import Enum

from fleet.allocators.balancing_problem import balancing_problem, explanation, named
from fleet.allocators.base import AllocationProblem, Allocator, Assignment, NotAllocated
from fleet.allocators.load_balancing.balance import balance
from fleet.allocators.load_balancing.problem import BalancedAssignment, NoAssignment
from fleet.allocators.min_max_load_milp import MinMaxLoadProgram, max_load, solve
from fleet.allocators.round_robin import assign_in_turn
from keyexpr_schema.payloads.plans import Violation

log = logging.getLogger(__name__)

TIME_LIMIT_S = 20.0
"""Wall time given to the solver, s; the best answer so far is taken: every answer is checked."""
IMPROVE_LIMIT_S = 3.0
"""Wall time to better an assignment that is there already, s at most. If the solver gets anywhere
with it, it has within a second; what is left is to prove that 20 alike robots cannot do with less.
"""
TRAVEL_LIMIT_S = 2.0
"""Wall time for the least travel at most, s."""
TRAVEL_GAP = 1e-3
"""Relative gap at which the least travel is near enough: a second in a quarter of an hour."""
MAX_VARIABLES = 100_000
"""Pairs of an actor and a robot that are put to the solver: so many take some seconds."""


class TieBreak(Enum):
    """Which of the allocations with the least maximum load; the value is the allocator's name."""

    NEXT_LOADS = "balanced"
    """The one whose next greatest load is least, and so on: lexicographic min-max fairness."""
    TRAVEL = "milp"
    """The one whose robots have the least way to where they start."""


class MinMaxLoadAllocator(Allocator):
    """Minimise the largest number of tasks on a robot (RobotFleet, Gupta et al.), on actors.

    Every actor is one robot that is able to be it; actors that meet in one task are different
    robots. What is not proven is noted, with what is.

    With `fallback_round_robin` the paper's round-robin takes over where nothing is found, and a
    note in the answer says so. It still gives no robot what it cannot do.
    """

    def __init__(
        self,
        tie_break: TieBreak,
        fallback_round_robin: bool = False,
        time_limit_s: float = TIME_LIMIT_S,
    ) -> None:
        self.name = f"{tie_break.value}-or-round-robin" if fallback_round_robin else tie_break.value
        self._tie_break = tie_break
        self._fallback = fallback_round_robin
        self._time_limit_s = time_limit_s

    def _assign(self, problem: AllocationProblem) -> Assignment | NotAllocated:
        if self._tie_break is TieBreak.NEXT_LOADS:
            found = assign_balanced(problem)
        else:
            found = assign_with_least_travel(problem, self._time_limit_s)
        if self._fallback and isinstance(found, NotAllocated):
            return in_turn_instead(problem, found)
        return found


def assign_balanced(problem: AllocationProblem) -> Assignment | NotAllocated:
    """Lexicographically least loads: exact for actors of equal load that need not be apart, for
    small problems, and wherever the lower bound is met."""
    found = balance(balancing_problem(problem))
    if isinstance(found, NoAssignment):
        return explanation(problem, found)
    robots = named(problem, found.robot)
    if found.optimal:
        return Assignment(robots)
    note = (
        f"the busiest robot has {found.loads[0]} tasks, and one must have {found.lower_bound} at "
        "least; that no loads are more even is not proven"
    )
    return Assignment(robots, notes=(note,))


def assign_with_least_travel(
    problem: AllocationProblem, time_limit_s: float = TIME_LIMIT_S
) -> Assignment | NotAllocated:
    """Least maximum load, then least travel, by the paper's program within `time_limit_s` [s].

    The program gets the balanced assignment's maximum and bound: identical robots would keep its
    solver busy for ever otherwise. Where the bound is met, travel is all that is left to minimise.
    """
    time_limit_s = problem.search_s(time_limit_s)
    end_s = time.monotonic() + time_limit_s
    balanced = balance(balancing_problem(problem))
    if isinstance(balanced, BalancedAssignment):
        if sum(map(len, problem.able.values())) > MAX_VARIABLES:
            note = (
                f"more than {MAX_VARIABLES} choices are too many for the solver: loads are "
                "balanced without it, and travel is not looked at"
            )
            return Assignment(named(problem, balanced.robot), notes=(note,))
    elif balanced.proven:
        return explanation(problem, balanced)
    robots, proven = _least_max_load(problem, balanced, time_limit_s)
    if robots is None:
        return explanation(problem, NoAssignment(proven))
    robots = _least_travel(problem, robots, min(TRAVEL_LIMIT_S, end_s - time.monotonic()))
    if proven:
        return Assignment(robots)
    note = (
        f"the busiest robot has {max_load(robots, problem.load)} tasks, and the solver has not "
        "proven in its time that it cannot have fewer"
    )
    return Assignment(robots, notes=(note,))


def in_turn_instead(problem: AllocationProblem, refused: NotAllocated) -> Assignment | NotAllocated:
    """The fallback to round-robin where the program found nothing, with a note that says so."""
    why = refused.violations[0].sentence
    found = assign_in_turn(problem)
    if isinstance(found, NotAllocated):
        sentence = f"round-robin instead of the MILP finds none either: {why}"
        return NotAllocated((Violation(code="no-allocation", sentence=sentence),))
    note = f"allocated by round-robin and not by the MILP: {why}"
    log.warning(note)
    return Assignment(found.allocation, notes=(note,))


def _least_max_load(
    problem: AllocationProblem, balanced: BalancedAssignment | NoAssignment, limit_s: float
) -> tuple[dict[str, str] | None, bool]:
    """Robots with the least maximum load, if there are any, and whether that is proven."""
    lower, upper, best = 0, None, None
    if isinstance(balanced, BalancedAssignment):
        best, lower = named(problem, balanced.robot), balanced.lower_bound
        upper = max(balanced.loads, default=0) - 1
        if upper < lower:
            return best, True
        limit_s = min(limit_s, IMPROVE_LIMIT_S)
    program = MinMaxLoadProgram(problem.able, problem.load, problem.apart)
    program.minimise_max_load(lower, upper)
    found = solve(program.model, limit_s)
    if not found.values:
        return best, found.proven
    robots = program.robots(found.values)
    return robots, found.proven or max_load(robots, problem.load) == lower


def _least_travel(
    problem: AllocationProblem, known: dict[str, str], limit_s: float
) -> dict[str, str]:
    """Of the robots of which none has more tasks than in `known`, those with the least travel, if
    the solver finds them in time; else the known ones."""
    travel_s = problem.approach_s()
    free = any(len({travel_s[a, r] for r in robots}) > 1 for a, robots in problem.able.items())
    if not free or limit_s <= 0:
        return known
    program = MinMaxLoadProgram(problem.able, problem.load, problem.apart)
    program.minimise_travel(travel_s, max_load(known, problem.load))
    found = solve(program.model, limit_s, TRAVEL_GAP)
    if not found.values:
        return known
    return min(
        (program.robots(found.values), known),
        key=lambda robots: sum(travel_s[pair] for pair in robots.items()),
    )
