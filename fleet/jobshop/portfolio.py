"""All ways to a short schedule together: rules at once, then annealing beside CP-SAT."""

from __future__ import annotations

import time
from dataclasses import replace
from math import ceil

from fleet.jobshop.bounds import bound_with_travel, lower_bound
from fleet.jobshop.forward_pass import Solution, schedule_of
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.problem import Schedule, Shop
from fleet.jobshop.search.annealing import anneal
from fleet.jobshop.search.branch_and_bound import branch_and_bound
from fleet.jobshop.search.cpsat import CpSat, helps, installed
from fleet.jobshop.search.list_scheduling import dispatching_rules, list_schedule, random_restarts
from fleet.jobshop.time_budget import TimeBudget

RULES_SHARE = 0.3
"""Of the time, how much dispatching rules may take before the search begins."""
START_UP_S = 0.8
"""What starting a process and importing OR-Tools takes, s; CP-SAT gets so much more time."""
NEAR = 1e-4
"""Relative gap from which on nothing more is done to close it."""
MET = 1e-6
"""Relative difference between makespan and bound that counts as none."""


def solve(shop: Shop, budget: TimeBudget, exact: bool = True, seed: int = 0) -> Schedule | None:
    """The best schedule found within the `budget` (the list schedule however long that takes).

    `exact` allows CP-SAT, where it is installed and the size is right; it then takes up to
    `START_UP_S` longer, unless the schedule was proven optimal before. `None` if no rule finds any
    schedule, which happens only where few machines will do for a block.

    Raises:
        BadShop: the problem contradicts itself.
    """
    instance = Instance(shop)
    listed = list_schedule(instance)
    best = dispatching_rules(instance, listed, budget.until(RULES_SHARE))
    if best is None:
        best = random_restarts(instance, budget, seed)
    if best is None:
        return None
    bound_s = lower_bound(instance)
    if instance.whole:
        bound_s = float(ceil(bound_s - MET))
    notes = ["list schedule" if best is listed else "dispatch rule"]
    optimum = None if _met(best, bound_s) else branch_and_bound(instance, best)
    if optimum is not None:
        best = optimum.solution
        if optimum.proven:
            bound_s = max(bound_s, best.makespan_s)
        notes.append("every schedule looked at")
    found = schedule_in_order(instance, best)
    if not _met(best, bound_s) and (optimum is None or (exact and installed())):
        found, bound_s, how = _search(instance, best, found, bound_s, budget, exact, seed)
        notes.append(how)
        if instance.travels and found.makespan_s > bound_s * (1 + NEAR):
            bound_s = max(bound_s, bound_with_travel(instance))
    return replace(found, lower_bound_s=min(bound_s, found.makespan_s), notes=tuple(notes))


def schedule_in_order(instance: Instance, solution: Solution) -> Schedule:
    """The solution in terms of the shop's operations."""
    order = [b for c in solution.order for b in instance.component_blocks[c]]
    found = schedule_of(instance.shop, order, solution.machine_of)
    assert found is not None, "an order of components has no deadlock"
    return found


def _search(
    instance: Instance,
    best: Solution,
    schedule: Schedule,
    bound_s: float,
    budget: TimeBudget,
    exact: bool,
    seed: int,
) -> tuple[Schedule, float, str]:
    """A better schedule, the better bound, and who found it."""
    run = None
    if exact and installed() and helps(instance):
        until_s = time.time() + budget.left_s + START_UP_S
        run = CpSat(instance, best, bound_s, until_s, seed)
    how = "search"
    try:
        # CP-SAT that has ended has found the best there is, or gave up.
        found = anneal(
            instance, best, budget, bound_s, seed, stopped=lambda: run is not None and run.ended
        )
        if found.cost < best.cost:
            schedule, how = schedule_in_order(instance, found), "annealing"
        if run is not None and not _met(found, bound_s):
            proof = run.result()
            bound_s = max(bound_s, proof.lower_bound_s)
            if proof.order is not None and proof.machine_of is not None:
                exactly = schedule_of(instance.shop, proof.order, proof.machine_of)
                if exactly is not None and exactly.makespan_s < schedule.makespan_s - 1e-9:
                    schedule, how = exactly, "CP-SAT"
            if proof.status == "OPTIMAL" and schedule.makespan_s <= bound_s * (1 + NEAR):
                how += ", proven by CP-SAT"
    finally:
        if run is not None:
            run.close()
    return schedule, bound_s, how


def _met(solution: Solution, bound_s: float) -> bool:
    return solution.makespan_s <= bound_s * (1 + MET)
