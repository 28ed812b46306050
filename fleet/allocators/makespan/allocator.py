"""The allocator that makes the plan end as early as it can: robots and their order together."""

from __future__ import annotations

from collections.abc import Mapping

from fleet.allocators.base import AllocationProblem, Allocator, Assignment, NotAllocated
from fleet.allocators.makespan.plan_shop import plan_shop
from fleet.allocators.makespan.portfolio import solve
from fleet.allocators.milp import MilpAllocator

DEADLINE_S = 1.0
"""Wall time that the search may take, s."""


class MakespanAllocator(Allocator):
    """Least makespan, with durations from skill models, travel and the order of actors.

    List scheduling and dispatch rules at once; then annealing until the deadline, with CP-SAT
    beside it where OR-Tools is installed (extra `cp-sat`) and the plan is small enough. The answer
    says how far from optimal it is at most.
    """

    name = "makespan"

    def __init__(self, deadline_s: float = DEADLINE_S, exact: bool = True, seed: int = 0) -> None:
        """`exact` allows CP-SAT, which may take up to a second more to prove an optimum."""
        self._deadline_s = deadline_s
        self._exact = exact
        self._seed = seed

    def _assign(self, problem: AllocationProblem) -> Assignment | NotAllocated:
        made = plan_shop(problem)
        found = solve(made.shop, self._deadline_s, self._exact, self._seed)
        if found is None:
            # Robots are so few that rules run into a dead end: what is left is a matching problem.
            chosen = MilpAllocator()._assign(problem)
            return chosen if isinstance(chosen, NotAllocated) else _by_load(chosen)
        machine_of = dict(enumerate(found.machine_of))
        return Assignment(
            allocation={
                actor: made.robots[machine_of[block]] for block, actor in enumerate(made.actors)
            },
            sequence=tuple(made.actors[b] for b in found.order if b < len(made.actors)),
            lower_bound_s=found.lower_bound_s,
            notes=found.notes,
        )


def _by_load(chosen: Mapping[str, str] | Assignment) -> Assignment:
    allocation = chosen.allocation if isinstance(chosen, Assignment) else chosen
    return Assignment(allocation, notes=("load balanced: no rule found an order",))
