"""The checker against brute force: a plan passes exactly if every order the DAG allows works."""

from __future__ import annotations

from itertools import combinations, pairwise

from hypothesis import given, settings

from fleet.core.checker.plan_checker import check_allocation, check_plan
from fleet.core.model.preconditions import applicable, made_true
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel, condition_holds
from keyexpr_schema.facts import FactKey, Value
from keyexpr_schema.ids import bare_name
from keyexpr_schema.payloads.goals import Precedence
from keyexpr_schema.payloads.plans import Plan
from tests.support import random_kitchen_plans
from tests.support.random_kitchen_plans import kitchen_plans
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

    def kept(facts: dict[FactKey, Value]) -> bool:
        return all(condition_holds(facts, row, world) for row in plan.always) and not any(
            condition_holds(facts, row, world) for row in plan.never
        )

    def in_order(facts: dict[FactKey, Value], passed: set[Precedence]) -> bool:
        """Whether nothing holds too early; what has held from now on is noted."""
        early = (
            row not in passed and condition_holds(facts, row.then, world)
            for row in plan.sometime_before
        )
        if any(list(early)):
            return False
        passed.update(r for r in plan.sometime_before if condition_holds(facts, r.first, world))
        return True

    for order in orders(graph):
        facts = dict(world.facts)
        passed = set[Precedence]()
        if not kept(facts) or not in_order(facts, passed):
            return False
        for name in order:
            action = actions[name]
            if not applicable(action, facts, world):
                return False
            facts.update(made_true(action, facts, world))
            if not kept(facts) or not in_order(facts, passed):
                return False
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


@reaches(
    *("goal-unmet", "constraint-violated"),
    least={
        "good with a constraint": 20,
        "good with something that may only hold later": 10,
        "something holds too early": 10,
        "good": 100,
        "bad": 100,
        **dict.fromkeys(("good and open", "condition-undone", "condition-unmet"), 5),
        **dict.fromkeys((f"good with {skill}" for skill in random_kitchen_plans.SKILLS), 5),
        **dict.fromkeys(
            (f"bad at {skill}" for skill in random_kitchen_plans.SKILLS if skill != "fill"), 1
        ),
    },
)
@settings(max_examples=1500, deadline=None)
@given(kitchen_plans())
def test_formulas_hold_exactly_if_they_do_in_every_order(
    reached: Reached, drawn: tuple[Plan, WorldModel]
) -> None:
    plan, world = drawn
    allocation = random_kitchen_plans.ALLOCATION
    good = works(plan, world, allocation)
    violations = check_allocation(plan, world, allocation)
    assert (not violations) == good, violations
    if good:
        assert not check_plan(plan, world).violations
    skills = {task.task: task.skill for task in plan.tasks}
    reached["good" if good else "bad"] += 1
    reached["good and open"] += good and is_partial(plan)
    reached["good with a constraint"] += good and bool(plan.always or plan.never)
    mine = [row.then for row in plan.sometime_before]
    reached["good with something that may only hold later"] += good and bool(mine)
    reached["something holds too early"] += any(v.condition in mine for v in violations)
    reached.update({violation.code for violation in violations})
    if good:
        reached.update({f"good with {skill}" for skill in skills.values()})
    reached.update({f"bad at {skills[v.task]}" for v in violations if v.task is not None})
