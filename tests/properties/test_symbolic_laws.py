"""The symbolic planner from any start: hands may be full, goals may come on top of others."""

from __future__ import annotations

from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from fleet.allocators.base import Allocated
from fleet.core.checker.plan_checker import CheckedPlan, check_allocation, check_plan
from fleet.core.model.world import WorldModel
from fleet.planners.base import PlanningProblem
from fleet.service.composition import compose
from keyexpr_schema.facts import FactKey, Value
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.robots import RobotSpec
from tests.support.household import bring, carrier, home, manipulator
from tests.support.reached import Reached, reaches

PARTS = compose()
PLACES = ("kitchen", "hallway", "living_room")
STRATEGIES = ("big-dag", "per-goal", "monolithic")


@st.composite
def missions(draw: st.DrawFn) -> tuple[WorldModel, tuple[Goal, ...]]:
    """One or two hands and a basket; cups in rooms, in hands and in the basket; all of them are
    wanted somewhere, or all but one. In the basket there is one at most: it can be in one place.
    Some hands are so slow that things had better ride in a basket.
    """
    arms = ["hsr", "r2"][: draw(st.integers(1, 2))]
    hands = [_driving(manipulator(name), draw(st.sampled_from((0.6, 0.1)))) for name in arms]
    robots = (*hands, carrier("locobot"))
    cups = draw(st.integers(1, 4))
    facts: dict[FactKey, Value] = {}
    for spec in robots:
        facts[FactKey("at", spec.robot)] = draw(st.sampled_from((*PLACES, None)))
    free_hands = list(arms)
    riding = ""
    goals: list[Goal] = []
    for number in range(1, cups + 1):
        name = f"cup_{number}"
        where = draw(st.sampled_from(("room", "hand", "basket")))
        to = draw(st.sampled_from(PLACES))
        facts[FactKey("at", name)] = draw(st.sampled_from(PLACES))
        if where == "hand" and free_hands:
            hand = free_hands.pop()
            facts[FactKey("holding", hand)] = name
            facts[FactKey("at", name)] = hand
        elif where == "basket" and not riding:
            riding = to
            facts[FactKey("at", name)] = "locobot"
        goals.append(bring(number, to))
    if len(goals) > 1 and draw(st.booleans()):
        goals.pop(draw(st.integers(0, len(goals) - 1)))
    return home(robots, cups).with_facts(facts), tuple(goals)


def _driving(spec: RobotSpec, speed_m_s: float) -> RobotSpec:
    return replace(spec, capabilities={**spec.capabilities, "drive": speed_m_s})


def undone_by_a_helper() -> tuple[WorldModel, tuple[Goal, ...]]:
    """The cup in the helper's basket is where it should be, until the helper drives for another."""
    facts = {
        FactKey("at", "hsr"): "kitchen",
        FactKey("at", "locobot"): "kitchen",
        FactKey("holding", "hsr"): "cup_4",
        FactKey("at", "cup_4"): "hsr",
        FactKey("at", "cup_2"): "locobot",
        FactKey("at", "cup_3"): "hallway",
    }
    world = home((manipulator(), carrier()), 4).with_facts(facts)
    return world, tuple(bring(number, "kitchen") for number in (1, 2, 3))


def done_by_a_helper() -> tuple[WorldModel, tuple[Goal, ...]]:
    """On its way to help, the helper takes what is in its basket where that is wanted."""
    facts = {
        FactKey("at", "hsr"): "hallway",
        FactKey("holding", "hsr"): "cup_2",
        FactKey("at", "cup_1"): "hallway",
        FactKey("at", "cup_2"): "hsr",
        FactKey("at", "cup_3"): "locobot",
    }
    world = home((manipulator(), carrier()), 3).with_facts(facts)
    return world, (bring(1, "kitchen"), bring(3, "hallway"))


def better_carried() -> tuple[WorldModel, tuple[Goal, ...]]:
    """The hand is so slow that things ride in a basket."""
    world = home((_driving(manipulator(), 0.1), carrier()), 2)
    return world, (bring(1, "hallway"), bring(2, "hallway"))


@reaches(*STRATEGIES, "pick", "place", "place_on_robot", "pinned", "one goal after the other")
@settings(max_examples=60, deadline=None)
@given(missions(), st.sampled_from(STRATEGIES))
@example(undone_by_a_helper(), "monolithic")
@example(undone_by_a_helper(), "big-dag")
@example(undone_by_a_helper(), "per-goal")
@example(done_by_a_helper(), "monolithic")
@example(better_carried(), "big-dag")
@example(better_carried(), "monolithic")
def test_what_can_be_done_is_planned_and_allocated(
    reached: Reached, mission: tuple[WorldModel, tuple[Goal, ...]], strategy: str
) -> None:
    world, goals = mission
    problem = PlanningProblem("p", goals, world, strategy=strategy)
    made = PARTS.planners["symbolic"].plan(problem)
    assert isinstance(made, CheckedPlan), made.reason
    assert isinstance(check_plan(made.plan, world), CheckedPlan)
    found = PARTS.allocators["milp"].allocate(made)
    assert isinstance(found, Allocated), found.violations
    order = found.schedule.extra_after
    assert check_allocation(made.plan, world, found.allocation, order) == ()
    reached.update({strategy, *(task.skill for task in made.plan.tasks)})
    reached["pinned"] += bool(made.plan.pins)
    reached["one goal after the other"] += any(
        len(row) > 1 for row in found.schedule.sequence.values()
    )
