"""Least maximum load, then least next load, and so on: exact where that can be, bounded elsewhere.

Three ways, the first that fits:

1. Every actor has the same load and none must be apart: an optimal semi-matching, at any size.
2. The relaxation that splits actors into single tasks is an optimal semi-matching again. Its sorted
   loads are majorized by those of every assignment that splits no actor (ibid., theorem 3.5), so
   none is lexicographically less: an assignment with the same loads is proven to be the best one.
3. With unequal loads the problem holds PARTITION, with pairs apart graph colouring, and is NP-hard:
   longest tasks first (LPT; Graham, "Bounds on multiprocessing timing anomalies", 1969), then move
   and swap while that helps, then branch and bound within a number of steps. What is not proven
   then is said, beside the relaxation's maximum, below which nothing can be.
"""

from __future__ import annotations

from functools import reduce
from math import gcd

from fleet.allocators.load_balancing.branch_and_bound import branch_and_bound
from fleet.allocators.load_balancing.local_search import PartialAssignment, improve, longest_first
from fleet.allocators.load_balancing.problem import (
    BalancedAssignment,
    LoadBalancingProblem,
    NoAssignment,
    overfull_clique,
)
from fleet.allocators.load_balancing.robot_sets import classes_of
from fleet.allocators.load_balancing.semi_matching import loads_of, robots_of, semi_matching


def balance(problem: LoadBalancingProblem) -> BalancedAssignment | NoAssignment:
    """Assign actors to robots so that the sorted loads are lexicographically least.

    Raises:
        ValueError: an actor has no able robot, or a load below 1.
    """
    if any(load < 1 for load in problem.load):
        raise ValueError("an actor's load must be at least one task")
    if not all(problem.able):
        raise ValueError(f"no robot can be actor {list(problem.able).index(0)}")
    unit = reduce(gcd, problem.load, 0) or 1
    classes = classes_of(problem.able, problem.robots)
    members = [len(robots) for robots in classes.robots]
    counts = [sum(problem.load[a] // unit for a in actors) for actors in classes.actors]
    flow = semi_matching(counts, classes.able, members)
    relaxed = [unit * load for load in loads_of(flow, members)]
    lower_bound = max(relaxed, default=0)
    equal = all(load == unit for load in problem.load)
    if equal and not problem.apart:
        return BalancedAssignment(robots_of(classes, flow), relaxed, lower_bound, optimal=True)
    if clique := overfull_clique(problem):
        return NoAssignment(True, clique)
    best: PartialAssignment | None = None
    if equal:
        best = improve(PartialAssignment(problem, robots_of(classes, flow)), relaxed)
    if best is None or best.sorted_loads() != relaxed:
        greedy = longest_first(problem)
        found = [best, greedy and improve(greedy, relaxed)]
        best = min(filter(None, found), key=PartialAssignment.sorted_loads, default=None)
    complete = best is not None and best.sorted_loads() == relaxed
    if not complete:
        best, complete = branch_and_bound(problem, best, relaxed)
    if best is None:
        return NoAssignment(complete)
    loads = best.sorted_loads()
    return BalancedAssignment(best.robot, loads, loads[0] if complete else lower_bound, complete)
