"""A good allocation at once: to compare plans by, before an allocator takes its time."""

from __future__ import annotations

from collections.abc import Mapping

from fleet.core.actors import actors_apart, least_loaded
from fleet.core.checker.plan_checker import CheckedPlan
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.search.branch_and_bound import branch_and_bound
from fleet.jobshop.search.list_scheduling import dispatching_rules
from fleet.jobshop.time_budget import TimeBudget
from fleet.scheduling.plan_shop import plan_shop


def quick_allocation(checked: CheckedPlan, most_nodes: int = 0) -> Mapping[str, str] | None:
    """Each actor to a robot, by the best of a few dispatching rules; `None` where robots are few.

    Of a small plan it is the best there is, if no more than `most_nodes` have to be looked at.
    Where the rules lead to a dead end, robots are taken by how much they have to do.
    """
    plan = plan_shop(checked, checked.able, actors_apart(checked))
    instance = Instance(plan.shop)
    found = dispatching_rules(instance, None, TimeBudget(0.0))
    if found is None:
        return least_loaded(checked)
    optimum = branch_and_bound(instance, found, most_nodes) if most_nodes else None
    if optimum is not None:
        found = optimum.solution
    return {actor: plan.robots[found.machine_of[block]] for block, actor in enumerate(plan.actors)}
