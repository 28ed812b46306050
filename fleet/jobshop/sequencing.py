"""Orders in which machines can take their blocks, where it is settled which machine does each."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, islice, permutations

from fleet.jobshop.forward_pass import Solution, evaluate
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.problem import Shop
from fleet.jobshop.search.annealing import anneal
from fleet.jobshop.search.branch_and_bound import branch_and_bound
from fleet.jobshop.search.list_scheduling import list_schedule
from fleet.jobshop.time_budget import TimeBudget

FEW = 5
"""Components of which every order is given (120), behind those that were searched for."""
ALPHAS = (None, 0.1, 1.0)
"""Rules to begin from: the first that leads to a schedule."""
MOST_NODES = 1000
"""Placements looked at for the best order of a small shop."""


def sequences(shop: Shop, budget: TimeBudget) -> Iterator[list[int]]:
    """Orders of all blocks, each different on some machine; the first is the best.

    Every block has one machine. The search begins from list scheduling: in a small shop it finds
    the best there is, in a larger one what annealing comes to within the `budget`. Behind it come
    what it began from, other rules, and every order of a few components.
    """
    instance = Instance(shop)
    found = (list_schedule(instance, alpha) for alpha in ALPHAS)
    rules = (solution for solution in found if solution is not None)
    searched: list[Solution] = []
    for begin in islice(rules, 1):
        optimum = branch_and_bound(instance, begin, MOST_NODES)
        best = anneal(instance, begin, budget) if optimum is None else optimum.solution
        searched = [best, begin]
    given: set[tuple[tuple[int, ...], ...]] = set()
    for solution in chain(searched, rules, _every_order(instance)):
        yield from _new(instance, solution.order, given)


def _every_order(instance: Instance) -> Iterator[Solution]:
    """The shortest first; none where there are more than a few components."""
    count = len(instance.component_blocks)
    machine_of = [block.machines[0] for block in instance.shop.blocks]
    found = []
    for order in permutations(range(count)) if count <= FEW else ():
        at = {component: i for i, component in enumerate(order)}
        if all(
            at[before] < at[component]
            for component in order
            for before in instance.component_predecessors[component]
        ):
            found.append(evaluate(instance, list(order), machine_of))
    yield from sorted((s for s in found if s is not None), key=lambda solution: solution.cost)


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
