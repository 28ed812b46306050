"""All ways to a short schedule together: rules at once, then annealing beside CP-SAT."""

from __future__ import annotations

import time
from math import ceil
from random import Random

from fleet.jobshop.annealing import anneal
from fleet.jobshop.bounds import bound_with_ways, lower_bound
from fleet.jobshop.branch_and_bound import exhaust
from fleet.jobshop.budget import Budget
from fleet.jobshop.compiled import Compiled
from fleet.jobshop.cpsat import CpSat, installed
from fleet.jobshop.cpsat_request import helps
from fleet.jobshop.list_scheduling import ALPHAS, Answer, construct
from fleet.jobshop.problem import Shop, Timed
from fleet.jobshop.timing import timed

RULES_SHARE = 0.3
"""Of the time, how much dispatch rules may take before the search begins."""
ALWAYS = 200
"""Steps up to which every rule is tried whatever the time: a few milliseconds each."""
AT_LEAST = 50
"""Tries at random, where rules find nothing, whatever the time."""
START_UP_S = 0.8
"""What starting a process and importing OR-Tools takes, s; CP-SAT gets so much more time."""
NEAR = 1e-4
"""Relative gap from which on nothing more is done to close it."""
MET = 1e-6
"""Relative difference between makespan and bound that counts as none."""


def solve(shop: Shop, budget: Budget, exact: bool = True, seed: int = 0) -> Timed | None:
    """The best schedule found within the `budget` (the list schedule however long that takes).

    `exact` allows CP-SAT, where it is installed and the size is right; it then takes up to
    `START_UP_S` longer, unless the schedule was proven optimal before. `None` if no rule finds any
    schedule, which happens only where few machines will do for a block.

    Raises:
        BadShop: the problem contradicts itself.
    """
    ready = Compiled(shop)
    listed = construct(ready)
    best = rules(ready, listed, budget.until(RULES_SHARE))
    if best is None:
        best = persist(ready, budget, seed)
    if best is None:
        return None
    bound_s = lower_bound(ready)
    if ready.whole:
        bound_s = float(ceil(bound_s - MET))
    notes = ["list schedule" if best is listed else "dispatch rule"]
    answer = timed(shop, blocks_in_order(ready, best), best.machine_of, bound_s)
    assert answer is not None, "an order of knots has no deadlock"
    all_tried = None if _met(best, bound_s) else exhaust(ready, best)
    if all_tried is not None:
        best = all_tried.answer
        made = timed(shop, blocks_in_order(ready, best), best.machine_of)
        assert made is not None, "an order of knots has no deadlock"
        answer = made
        if all_tried.proven:
            bound_s = max(bound_s, best.rated.makespan_s)
        notes.append("every schedule looked at")
    if not _met(best, bound_s) and (all_tried is None or (exact and installed())):
        answer, bound_s, how = _search(shop, ready, best, answer, bound_s, budget, exact, seed)
        notes.append(how)
        if ready.travels and answer.makespan_s > bound_s * (1 + NEAR):
            bound_s = max(bound_s, bound_with_ways(ready))
    return Timed(
        answer.machine_of,
        answer.order,
        answer.start_s,
        answer.end_s,
        min(bound_s, answer.makespan_s),
        tuple(notes),
    )


def rules(shop: Compiled, best: Answer | None, budget: Budget) -> Answer | None:
    """The best of the list schedule `best` and dispatch rules, tried until the `budget` is over.

    Those that are tried at small sizes take no time worth counting.
    """
    for alpha in ALPHAS:
        small = len(shop.befores) <= ALWAYS
        if best is not None and not small and budget.over:
            break
        found = construct(shop, alpha, budget=None if small or best is None else budget)
        if found is not None and (best is None or found.rated.cost < best.rated.cost):
            best = found
    return best


def persist(shop: Compiled, budget: Budget, seed: int) -> Answer | None:
    """Some schedule where rules run into dead ends: blocks of a knot in other orders, machines at
    random for a knot after the other."""
    random = Random(seed)
    tries = 0
    while tries < AT_LEAST or not budget.over:
        tries += 1
        for together in shop.knot_blocks:
            random.shuffle(together)
        found = construct(shop, random.choice((None, *ALPHAS)), at_random=random)
        if found is not None:
            return found
    return None


def blocks_in_order(shop: Compiled, answer: Answer) -> list[int]:
    """Blocks in the order of their knots."""
    return [block for knot in answer.order for block in shop.knot_blocks[knot]]


def _search(
    shop: Shop,
    ready: Compiled,
    best: Answer,
    answer: Timed,
    bound_s: float,
    budget: Budget,
    exact: bool,
    seed: int,
) -> tuple[Timed, float, str]:
    """A better answer, the better bound, and who found it."""
    run = None
    if exact and installed() and helps(ready):
        until_s = time.time() + budget.left_s + START_UP_S
        run = CpSat(ready, best, bound_s, until_s, seed)
    how = "search"
    try:
        found = anneal(ready, best, budget, bound_s, seed, stopped=lambda: ended(run))
        if found.rated.cost < best.rated.cost:
            better = timed(shop, blocks_in_order(ready, found), found.machine_of)
            if better is not None:
                answer = better
                how = "annealing"
        if run is not None and not _met(found, bound_s):
            proof = run.result()
            bound_s = max(bound_s, proof.lower_bound_s)
            if proof.order is not None and proof.machine_of is not None:
                exactly = timed(shop, proof.order, proof.machine_of)
                if exactly is not None and exactly.makespan_s < answer.makespan_s - 1e-9:
                    answer, how = exactly, "CP-SAT"
            if proof.status == "OPTIMAL" and answer.makespan_s <= bound_s * (1 + NEAR):
                how += ", proven by CP-SAT"
    finally:
        if run is not None:
            run.close()
    return answer, bound_s, how


def ended(run: CpSat | None) -> bool:
    """Whether CP-SAT was asked and has ended: it has found the best there is, or gave up."""
    return run is not None and run.ended


def _met(answer: Answer, bound_s: float) -> bool:
    return answer.rated.makespan_s <= bound_s * (1 + MET)
