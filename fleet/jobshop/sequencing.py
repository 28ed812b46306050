"""Orders in which machines can take their blocks, where it is settled which machine does each."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations

from fleet.jobshop.forward_pass import Solution, evaluate
from fleet.jobshop.instance import Instance
from fleet.jobshop.problem import Shop
from fleet.jobshop.search.annealing import anneal
from fleet.jobshop.search.branch_and_bound import branch_and_bound
from fleet.jobshop.search.list_scheduling import list_schedule
from fleet.jobshop.time_budget import TimeBudget

FEW = 5
"""Components of which every order is given (120), behind those that were searched for."""
ALPHAS = (0.1, 1.0)
"""Dispatching rules that a search begins from."""
MOST_NODES = 1000
"""Placements looked at for the best order of a small shop."""


def sequences(shop: Shop, budget: TimeBudget) -> Iterator[list[int]]:
    """Orders of all blocks, the best first, each different on some machine.

    Every block has one machine. They are those of dispatching rules, and the best there is in a
    small shop, or in a larger one what annealing finds within the `budget`.
    """
    instance = Instance(shop)
    found = [list_schedule(instance, alpha) for alpha in ALPHAS]
    solutions = [solution for solution in found if solution is not None]
    if solutions:
        best = min(solutions, key=_cost)
        optimum = branch_and_bound(instance, best, MOST_NODES)
        if optimum is not None:
            solutions.append(optimum.solution)
        else:
            solutions.append(anneal(instance, best, budget))
    given: set[tuple[tuple[int, ...], ...]] = set()
    for solution in sorted(solutions, key=_cost):
        yield from _new(instance, solution.order, given)
    if len(instance.component_blocks) <= FEW:
        for solution in sorted(_every_order(instance), key=_cost):
            yield from _new(instance, solution.order, given)


def _every_order(instance: Instance) -> Iterator[Solution]:
    machine_of = [block.machines[0] for block in instance.shop.blocks]
    for order in permutations(range(len(instance.component_blocks))):
        at = {component: i for i, component in enumerate(order)}
        if all(
            at[before] < at[component]
            for component in order
            for before in instance.component_predecessors[component]
        ):
            solution = evaluate(instance, list(order), machine_of)
            if solution is not None:
                yield solution


def _new(
    instance: Instance, order: list[int], given: set[tuple[tuple[int, ...], ...]]
) -> Iterator[list[int]]:
    """The blocks in this order of components, unless one `given` is the same on all machines."""
    blocks = [block for component in order for block in instance.component_blocks[component]]
    by_machine: list[list[int]] = [[] for _ in instance.shop.machines]
    for block in blocks:
        by_machine[instance.shop.blocks[block].machines[0]].append(block)
    signature = tuple(map(tuple, by_machine))
    if signature not in given:
        given.add(signature)
        yield blocks


def _cost(solution: Solution) -> float:
    return solution.cost
