"""What a subgoal costs beside many others, and what is planned when the time is short."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import pytest

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.core.model.skills import Action, SkillModel
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import StepClock, TimeBudget
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.planners.symbolic.action_sequences import (
    GaveUp,
    Impossible,
    Subgoal,
    alternatives_for,
)
from fleet.planners.symbolic.engine import finite_domain
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object, Place
from tests.support.household import SKILLS, at, carrier, fact, manipulator
from tests.support.household import cup as a_cup

ENOUGH = 1e9
FEW_OPERATORS = 40
"""Two kinds of hands and two of carriers, at the origin and the target of a cup."""


def a_house(cups: int, places: int, robots: int) -> WorldModel:
    """Rooms in a row, a cup in every other room again and again, and four kinds of robots."""
    rooms = [f"room_{i}" for i in range(places)]
    row = tuple(
        Place(
            place=room,
            label=room,
            travel_m={other: 3.0 * abs(i - k) for k, other in enumerate(rooms) if k != i},
        )
        for i, room in enumerate(rooms)
    )
    facts: list[Fact] = []
    specs: list[RobotSpec] = []
    for number in range(robots):
        spec = (
            manipulator(f"hand_{number}", grip_kg=1.0 + number % 4)
            if number % 2 == 0
            else carrier(f"cart_{number}", basket=1.0 + number % 4)
        )
        specs.append(spec)
        facts.append(fact(spec.robot, "at", rooms[number % places]))
        if number % 2 == 0:
            facts.append(fact(spec.robot, "holding", "nothing"))
    things = tuple(a_cup(number) for number in range(1, cups + 1))
    facts += [fact(thing.object, "at", rooms[2 * n % places]) for n, thing in enumerate(things)]
    return WorldModel.of(SKILLS, row, things, tuple(specs), facts)


def goals_for(world: WorldModel) -> tuple[Goal, ...]:
    """Every cup three rooms further; the later ones are the more urgent."""
    rooms = list(world.places)
    goals = []
    for number, thing in enumerate(world.objects):
        here = str(world.value("at", thing))
        to = rooms[(rooms.index(here) + 3) % len(rooms)]
        goals.append(
            Goal(
                goal=f"g{number}",
                text="",
                conditions=(at(thing, to),),
                priority=number,
                ordinal=number,
            )
        )
    return tuple(goals)


@pytest.fixture
def work(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How many actions were made of skills, and how many of them were operators of a task."""
    counts: Counter[str] = Counter()
    ground, operator = SkillModel.ground, finite_domain.Operator

    def grounded(skill: SkillModel, args: Mapping[str, str]) -> Action:
        counts["actions"] += 1
        return ground(skill, args)

    def made(*row: Any) -> finite_domain.Operator:
        counts["operators"] += 1
        return operator(*row)

    monkeypatch.setattr(SkillModel, "ground", grounded)
    monkeypatch.setattr(finite_domain, "Operator", made)
    return counts


def test_a_subgoal_costs_the_same_beside_many_goals_things_robots_and_places(
    work: Counter[str],
) -> None:
    rows = []
    for size in (1, 10):
        world = a_house(cups=10 * size, places=6 * size, robots=8 * size)
        (goal,) = goals_for(world)[:1]
        subgoal = Subgoal(goal.goal, goal.conditions[0])
        work.clear()
        found = alternatives_for(subgoal, dict(world.facts), world, TimeBudget(ENOUGH))
        assert isinstance(found, tuple)
        assert len(found[0]) > 1
        rows.append(dict(work))
    assert rows[0] == rows[1]
    assert rows[0]["operators"] <= FEW_OPERATORS


@pytest.mark.parametrize("strategy", SymbolicPlanner.strategies)
def test_of_many_goals_those_are_planned_for_which_there_is_time_the_urgent_ones_first(
    strategy: str,
) -> None:
    world = a_house(cups=40, places=10, robots=12)
    goals = goals_for(world)
    budget = TimeBudget(700.0, StepClock(1.0))
    made = SymbolicPlanner().plan(
        PlanningProblem("p", goals, world, strategy=strategy, budget=budget)
    )
    assert isinstance(made, CheckedPlan), made.reason
    planned = set(made.plan.goals)
    assert 0 < len(planned) < len(goals)
    assert planned == {goal.goal for goal in goals[-len(planned) :]}


def reached(world: WorldModel, condition: Condition) -> object:
    return alternatives_for(
        Subgoal("g", condition), dict(world.facts), world, TimeBudget(ENOUGH, StepClock(1.0))
    )


def cluttered(*more: Object, facts: tuple[Fact, ...] = ()) -> WorldModel:
    """Two rooms with so many trays that looking at every detour by them would take long."""
    places = (
        Place(place="kitchen", label="kitchen", travel_m={"hallway": 4.0}),
        Place(place="hallway", label="hallway", travel_m={"kitchen": 4.0}),
    )
    trays = tuple(
        Object(object=f"tray_{i}", kind="tray", label="tray", features=("supports", "contains"))
        for i in range(40)
    )
    hand = RobotSpec(
        robot="hsr",
        model="hsr",
        skills=tuple(name for name in SKILLS if name != "open"),
        capabilities={"drive": 0.6, "see": 4.0, "grip": 1.2, "reach": 1.0},
    )
    known = [fact(tray.object, "at", "hallway") for tray in trays]
    known += [fact("hsr", "at", "kitchen"), fact("hsr", "holding", "nothing"), *facts]
    return WorldModel.of(SKILLS, places, (*trays, *more), (hand,), known)


CUPBOARD = Object(
    object="cupboard",
    kind="cupboard",
    label="cupboard",
    movable=False,
    home="kitchen",
    features=("contains", "openable"),
)
ANNA = Object(object="anna", kind="person", label="Anna", movable=False, features=("person",))


@pytest.mark.parametrize(
    ("world", "condition", "why", "lost"),
    [
        (
            cluttered(a_cup(1, mass_kg=9.0), facts=(fact("cup_1", "at", "kitchen"),)),
            at("cup_1", "hallway"),
            "cup_1 weighs 9 kg",
            (),
        ),
        (
            cluttered(a_cup(1), CUPBOARD, facts=(fact("cup_1", "at", "cupboard"),)),
            at("cup_1", "hallway"),
            "hsr does not have the skill open",
            (),
        ),
        (cluttered(a_cup(1)), at("cup_1", "hallway"), "nobody knows where cup_1 is", ("cup_1",)),
        (
            cluttered(a_cup(1), ANNA, facts=(fact("cup_1", "at", "kitchen"),)),
            at("cup_1", "anna"),
            "nobody knows where anna is",
            ("anna",),
        ),
    ],
    ids=["too heavy", "behind a door", "lost", "for somebody who is lost"],
)
def test_where_no_detour_can_help_none_is_looked_at(
    world: WorldModel,
    condition: Condition,
    why: str,
    lost: tuple[str, ...],
    work: Counter[str],
) -> None:
    found = reached(world, condition)
    assert isinstance(found, Impossible)
    assert why in found.reason
    assert found.unlocated == lost
    assert work["operators"] <= FEW_OPERATORS


def test_looking_at_detours_ends_with_the_time() -> None:
    world = cluttered(a_cup(1, mass_kg=9.0), facts=(fact("cup_1", "at", "tray_1"),))
    subgoal = Subgoal("g", at("cup_1", "kitchen"))
    budget = TimeBudget(3.0, StepClock(1.0))
    found = alternatives_for(subgoal, dict(world.facts), world, budget)
    assert isinstance(found, GaveUp)
    assert "was still being worked out" in found.reason
    goal = Goal(goal="g", text="", conditions=(at("cup_1", "kitchen"),))
    made = SymbolicPlanner().plan(
        PlanningProblem("p", (goal,), world, budget=TimeBudget(2.0, StepClock(1.0)))
    )
    assert isinstance(made, NoPlan)
    assert made.postponed
