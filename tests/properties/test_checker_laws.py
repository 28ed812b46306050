"""The checker against brute force: a plan passes exactly if every order the DAG allows works."""

from __future__ import annotations

from itertools import combinations, pairwise

from hypothesis import given, settings

from fleet.core.checker.plan_checker import check_allocation, check_plan
from fleet.core.model.preconditions import first_unmet
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel, condition_holds, room_left
from keyexpr_schema.ids import bare_name
from keyexpr_schema.payloads.plans import Plan
from tests.support.random_plans import ALLOCATION, plans
from tests.support.reached import Reached, reaches


def orders(graph: TaskGraph, done: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every order of tasks that the graph allows."""
    ready = [t for t in graph.order if t not in done and graph.predecessors[t] <= set(done)]
    if not ready:
        return [done]
    return [order for task in ready for order in orders(graph, (*done, task))]


def is_partial(plan: Plan) -> bool:
    """Whether the graph leaves the order of some tasks open."""
    graph = TaskGraph({task.task: task.after for task in plan.tasks})
    return not all(graph.precedes(one, other) for one, other in pairwise(graph.order))


def works(plan: Plan, world: WorldModel, allocation: dict[str, str]) -> bool:
    """Carry the plan out in every order, one task at a time; and no robot may overlap."""
    graph = TaskGraph({task.task: task.after for task in plan.tasks})
    actions = {
        task.task: world.skills[task.skill].ground(
            {k: allocation.get(bare_name(v), v) for k, v in task.args.items()}
        )
        for task in plan.tasks
    }
    for one, other in combinations(graph.order, 2):
        shared = set(actions[one].participants) & set(actions[other].participants)
        if shared and not graph.precedes(one, other):  # their order is the graph's
            return False
    for order in orders(graph):
        facts = dict(world.facts)
        for name in order:
            action = actions[name]
            if first_unmet(action, facts, world) is not None or any(
                room_left(robot, facts, world) < 1 for robot in action.space_in
            ):
                return False
            facts.update({literal.variable: literal.value for literal in action.after})
        if not all(condition_holds(facts, condition, world) for condition in plan.conditions):
            return False
    return True


@reaches(
    *("robot-in-two-places", "goal-unmet", "no-space"),
    least={
        "good": 100,
        "bad": 100,
        **dict.fromkeys(
            ("good with a handover", "good and open", "condition-undone", "condition-unmet"), 5
        ),
    },
)
@settings(max_examples=500, deadline=None)
@given(plans())
def test_a_plan_passes_exactly_if_every_order_works(
    reached: Reached, drawn: tuple[Plan, WorldModel]
) -> None:
    plan, world = drawn
    good = works(plan, world, ALLOCATION)
    violations = check_allocation(plan, world, ALLOCATION)
    assert (not violations) == good, violations
    if good:  # each actor has at least the robot that it is here
        assert not check_plan(plan, world).violations
    reached["good" if good else "bad"] += 1
    reached["good with a handover"] += good and any(
        task.skill in ("place_on_robot", "unload") for task in plan.tasks
    )
    reached["good and open"] += good and is_partial(plan)
    reached.update({violation.code for violation in violations})
