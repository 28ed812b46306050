"""The checker against brute force: a plan passes exactly if every order the DAG allows works."""

from __future__ import annotations

from itertools import combinations

from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.core.checker import check_plan
from fleet.core.graph import TaskGraph
from fleet.core.skills import Variable
from fleet.core.world_model import WorldModel, condition_holds, first_unmet, room_left
from keyexpr_schema.plans import Plan, Task
from tests.household import at, carrier, home, manipulator

ROBOTS = ("hsr", "locobot")
PLACES = ("kitchen", "hallway")
CUPS = ("cup_1", "cup_2")
WORLD = home((manipulator(), carrier(basket=1)))


@st.composite
def plans(draw: st.DrawFn) -> Plan:
    """Small plans of allocated robots: sensible enough that some pass, random enough to fail."""
    tasks: list[Task] = []
    for number in range(draw(st.integers(1, 6))):
        skill = draw(st.sampled_from(["navigate", "pick", "place", "place_on_robot"]))
        robot = draw(st.sampled_from(ROBOTS)) if skill == "navigate" else "hsr"
        actor = {"hsr": "a1", "locobot": "a2"}[robot]
        place = draw(st.sampled_from(PLACES))
        args = {"robot": f"?{actor}"}
        if skill == "navigate":
            args["to"] = place
        else:
            args |= {"object": draw(st.sampled_from(CUPS)), "place": place}
        if skill == "place_on_robot":
            args["carrier"] = "locobot"
        names = [task.task for task in tasks]
        after = tuple(draw(st.lists(st.sampled_from(names), unique=True))) if names else ()
        if draw(st.booleans()):  # half of the time in order, so that whole sequences occur
            after = tuple(names)
        tasks.append(Task(task=f"t{number}", skill=skill, args=args, actor=actor, after=after))
    goal = at(draw(st.sampled_from(CUPS)), draw(st.sampled_from(PLACES)))
    return Plan(plan="p", goals=("g",), conditions=(goal,), tasks=tuple(tasks))


def orders(graph: TaskGraph, done: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every order of tasks that the graph allows."""
    ready = [t for t in graph.order if t not in done and graph.predecessors[t] <= set(done)]
    if not ready:
        return [done]
    return [order for task in ready for order in orders(graph, (*done, task))]


def works(plan: Plan, world: WorldModel, allocation: dict[str, str]) -> bool:
    """Carry the plan out in every order, one task at a time; and no robot may overlap."""
    graph = TaskGraph({task.task: task.after for task in plan.tasks})
    actions = {
        task.task: world.skills[task.skill].ground(
            {k: allocation.get(v.removeprefix("?"), v) for k, v in task.args.items()}
        )
        for task in plan.tasks
    }
    for one, other in combinations(graph.order, 2):
        shared = set(actions[one].participants) & set(actions[other].participants)
        if shared and not graph.ordered(one, other):
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
        if not all(condition_holds(facts, condition) for condition in plan.conditions):
            return False
    return True


@settings(max_examples=400, deadline=None)
@given(plans(), st.booleans())
def test_a_plan_passes_exactly_if_every_order_works(plan: Plan, in_kitchen: bool) -> None:
    allocation = {"a1": "hsr", "a2": "locobot"}
    world = WORLD.with_facts({Variable("at", "hsr"): "kitchen"}) if in_kitchen else WORLD
    assert check_plan(plan, world, allocation).valid == works(plan, world, allocation)
