"""The allocator that makes the plan end as early as it can: robots and their order together."""

from __future__ import annotations

import time
from dataclasses import replace

from fleet.allocators.base import AllocationProblem, Allocator, Assignment, NotAllocated
from fleet.allocators.min_max_load import assign_with_least_travel
from fleet.jobshop.portfolio import START_UP_S, solve
from fleet.jobshop.problem import Schedule
from fleet.jobshop.rescheduling import reschedule
from fleet.jobshop.time_budget import Clock, TimeBudget
from fleet.scheduling.allocation_context import AllocationContext
from fleet.scheduling.plan_shop import PlanShop, plan_shop

DEADLINE_S = 1.0
"""Time that the search may take, s."""
RESCHEDULE_SHARE = 0.5
"""Of that time, how much rescheduling takes: robots wait meanwhile."""
NOBODY = -1
"""The machine of actors whose robot is gone."""


class MakespanAllocator(Allocator):
    """Least makespan, with durations from skill models, travel and the order of actors.

    List scheduling and dispatching rules at once; then annealing until the deadline, with CP-SAT
    beside it where OR-Tools is installed (extra `cp-sat`) and the plan is small enough. The answer
    says how far from optimal it is at most.
    """

    name = "makespan"
    reschedules = True

    def __init__(
        self,
        deadline_s: float = DEADLINE_S,
        exact: bool = True,
        clock: Clock = time.perf_counter,
    ) -> None:
        """`exact` allows CP-SAT, which may take up to a second more to prove an optimum.

        `clock` is what the deadline goes by.
        """
        self._deadline_s = deadline_s
        self._exact = exact
        self._clock = clock

    def _assign(self, problem: AllocationProblem) -> Assignment | NotAllocated:
        plan = plan_shop(problem.checked, problem.able, problem.apart, problem.context)
        deadline_s = problem.search_s(self._deadline_s)
        if problem.context.previous_allocation:
            budget = TimeBudget(RESCHEDULE_SHARE * deadline_s, self._clock)
            rescheduled = _rescheduled(plan, problem.context, budget)
            if rescheduled is not None:
                return rescheduled
        budget = TimeBudget(deadline_s, self._clock)
        exact_s = deadline_s + START_UP_S
        exact = self._exact and problem.search_s(exact_s) == exact_s
        schedule = solve(plan.shop, budget, exact)
        if schedule is None:
            # Robots are so few that rules run into a dead end: what is left is a matching problem.
            chosen = assign_with_least_travel(problem)
            if isinstance(chosen, NotAllocated):
                return chosen
            return Assignment(chosen.allocation, notes=("load balanced: no rule found an order",))
        return _assignment(plan, schedule)


def _assignment(plan: PlanShop, schedule: Schedule) -> Assignment:
    """A schedule of the shop in terms of actors and robots."""
    return Assignment(
        allocation={a: plan.robots[schedule.machine_of[b]] for b, a in enumerate(plan.actors)},
        actor_order=tuple(plan.actors[b] for b in schedule.order if b < len(plan.actors)),
        lower_bound_s=schedule.lower_bound_s,
        notes=schedule.notes,
    )


def _rescheduled(
    plan: PlanShop, context: AllocationContext, budget: TimeBudget
) -> Assignment | None:
    """The allocation there was, with few actors in other hands."""
    machine = {robot: i for i, robot in enumerate(plan.robots)}
    named = plan.shop.blocks[len(plan.actors) :]
    previous = context.previous_allocation
    home = [machine.get(previous.get(actor, ""), NOBODY) for actor in plan.actors]
    home += [block.machines[0] for block in named]
    block_of = {actor: block for block, actor in enumerate(plan.actors)}
    order = [block_of[actor] for actor in context.actor_order if actor in block_of]
    repaired = reschedule(plan.shop, home, order, budget)
    if repaired is None:
        return None
    moved = sum(block < len(plan.actors) for block in repaired.moved)
    note = (
        f"rescheduled: {moved} of {len(plan.actors)} actors changed hands; "
        f"with any number of changes the least found is {repaired.best_makespan_s:.1f} s"
    )
    return _assignment(plan, replace(repaired.schedule, notes=(note,)))
