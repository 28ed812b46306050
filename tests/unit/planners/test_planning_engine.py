"""The engine for one goal: large worlds, tools, doors, states, and what it says of no way."""

from __future__ import annotations

import msgspec
import pytest

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import StepClock, TimeBudget
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.planners.symbolic.action_sequences import Impossible, Subgoal, alternatives_for
from fleet.planners.symbolic.engine.constraints import Trajectory
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object, Place
from tests.support.household import PLACES, SKILLS, at, carrier, fact, home, manipulator

FEW_STEPS = 2_000
"""Readings of the clock in which each of these is found; a blind search reads it 30,000 times."""
OWN = {
    "slice": {
        "parameters": {"robot": "robot", "object": "object", "tool": "object", "place": "place"},
        "needs": {"robot": ["grip"]},
        "before": [
            "at(robot) = place",
            "at(object) = place",
            "holding(robot) = tool",
            "sharp(tool) = true",
        ],
        "after": ["sliced(object) = true"],
        "duration_s": 60,
    },
    "wash": {
        "parameters": {"robot": "robot", "object": "movable", "sink": "sink", "place": "place"},
        "needs": {"robot": ["grip"]},
        "before": ["at(robot) = place", "in(object) = sink", "holding(robot) = nothing"],
        "after": ["clean(object) = true"],
        "duration_s": 40,
    },
    "fill": {
        "parameters": {"robot": "robot", "jug": "jug", "sink": "sink", "place": "place"},
        "needs": {"robot": ["grip"]},
        "before": ["at(robot) = place", "at(sink) = place", "holding(robot) = jug"],
        "after": ["level(jug) = 3"],
        "duration_s": 20,
    },
    "water": {
        "parameters": {"robot": "robot", "plant": "plant", "jug": "jug", "place": "place"},
        "needs": {"robot": ["grip"]},
        "before": [
            "at(robot) = place",
            "at(plant) = place",
            "holding(robot) = jug",
            "level(jug) >= 1",
        ],
        "after": ["watered(plant) = true", "level(jug) -= 1"],
        "duration_s": 20,
    },
}
ALL = {**SKILLS, **skills_from_data({"skills": OWN}, "own.yaml")}


def condition(relation: str, subject: str, value: str | bool | float) -> Condition:
    return Condition(relation=relation, subject=subject, value=value)


def made(world: WorldModel, *conditions: Condition, steps: int = FEW_STEPS) -> CheckedPlan | NoPlan:
    goal = Goal(goal="g", text="", conditions=conditions)
    budget = TimeBudget(float(steps), StepClock(1.0))
    return SymbolicPlanner().plan(PlanningProblem("p", (goal,), world, budget=budget))


def planned(world: WorldModel, *conditions: Condition) -> Plan:
    found = made(world, *conditions)
    assert isinstance(found, CheckedPlan), found.reason
    return found.plan


def skills(plan: Plan) -> list[str]:
    return [task.skill for task in plan.tasks]


def ancestors(plan: Plan, task: str) -> set[str]:
    """The tasks that it waits for, one after the other."""
    after = {row.task: row.after for row in plan.tasks}
    found: set[str] = set()
    open_ = [task]
    while open_:
        more = set(after[open_.pop()]) - found
        found |= more
        open_ += more
    return found


def able(spec: RobotSpec, *more: str) -> RobotSpec:
    return msgspec.structs.replace(
        spec, skills=tuple(dict.fromkeys((*SKILLS, *spec.skills, *more)))
    )


def thing(name: str, kind: str, *features: str, movable: bool = True, **more: object) -> Object:
    return Object(
        object=name,
        kind=kind,
        label=name,
        features=features,
        movable=movable,
        mass_kg=0.2,
        **more,  # type: ignore[arg-type]
    )


def kitchen(*facts: Fact) -> WorldModel:
    """A fridge and a sink in the kitchen, a cup in a cupboard that is closed, a jug, a plant."""
    objects = (
        thing("fridge", "fridge", "contains", "openable", movable=False, home="kitchen"),
        thing("cupboard", "cupboard", "contains", "openable", movable=False, home="hallway"),
        thing("sink", "sink", "contains", movable=False, home="kitchen"),
        thing("television", "television", "switchable", movable=False, home="living_room"),
        thing("cup", "cup"),
        thing("milk", "milk"),
        thing("jug", "jug"),
        thing("plant", "plant", movable=False, home="living_room"),
    )
    known = (
        fact("cup", "at", "cupboard"),
        fact("milk", "at", "hallway"),
        fact("jug", "at", "living_room"),
        fact("hsr", "holding", "nothing"),
        fact("other", "holding", "nothing"),
    )
    robots = (able(manipulator("hsr"), *OWN), able(manipulator("other"), *OWN), carrier())
    return WorldModel.of(ALL, PLACES, objects, robots, (*known, *facts))


def rooms(number: int) -> WorldModel:
    """A row of rooms, a cup at one end; arms and carts of two kinds each."""
    names = [f"room_{n}" for n in range(number)]
    places = tuple(
        Place(
            place=name,
            label=name,
            travel_m={other: 4.0 * abs(n - m) for m, other in enumerate(names) if n != m},
        )
        for n, name in enumerate(names)
    )
    robots = (
        manipulator("arm_1"),
        manipulator("arm_2", grip_kg=2.0),
        carrier("cart_1"),
        carrier("cart_2", basket=3.0),
    )
    facts = [fact(spec.robot, "at", names[7 * n % number]) for n, spec in enumerate(robots)]
    facts += [fact(arm, "holding", "nothing") for arm in ("arm_1", "arm_2")]
    facts.append(fact("cup_1", "at", names[1]))
    cup = Object(object="cup_1", kind="cup", label="cup", mass_kg=0.2)
    return WorldModel.of(SKILLS, places, (cup,), robots, facts)


@pytest.mark.parametrize("number", [15, 60])
def test_a_large_world_is_no_reason_for_a_no(number: int) -> None:
    plan = planned(rooms(number), at("cup_1", f"room_{number - 1}"))
    assert skills(plan)[:2] == ["navigate", "pick"]


def test_whatever_is_good_for_it_is_found_among_many_things() -> None:
    names = [f"thing_{n}" for n in range(19)]
    objects = tuple(thing(name, "thing") for name in (*names, "bread"))
    facts = [fact(name, "at", "hallway") for name in names]
    facts += [
        fact("bread", "at", "kitchen"),
        fact(names[-1], "sharp", value=True),  # type: ignore[arg-type]
        fact("hsr", "holding", "nothing"),
    ]
    world = WorldModel.of(ALL, PLACES, objects, (able(manipulator(), *OWN),), facts)
    plan = planned(world, condition("sliced", "bread", True))
    assert skills(plan) == ["navigate", "pick", "navigate", "slice"]
    assert plan.tasks[1].args["object"] == names[-1]


def test_what_is_in_a_closed_cupboard_is_reached_once_it_is_open() -> None:
    plan = planned(kitchen(), condition("held", "cup", True))
    opened = next(task for task in plan.tasks if task.skill == "open")
    picked = next(task for task in plan.tasks if task.skill == "pick")
    assert opened.args["thing"] == "cupboard"
    assert opened.task in ancestors(plan, picked.task)


def test_what_was_found_in_the_way_is_closed_first() -> None:
    found = (fact("cupboard", "blocked_by", "fridge"), fact("fridge", "is_open", value=True))  # type: ignore[arg-type]
    plan = planned(kitchen(*found), condition("held", "cup", True))
    by_skill = {task.skill: task for task in plan.tasks}
    assert by_skill["close"].args["thing"] == "fridge"
    assert by_skill["close"].task in ancestors(plan, by_skill["open"].task)
    assert "close" not in skills(planned(kitchen(found[0]), condition("held", "cup", True)))


def test_the_lower_of_two_drawers_is_looked_into_before_the_upper_one() -> None:
    """So that none has to be closed again."""
    drawers = [
        thing(f"drawer_{n}", "drawer", "contains", "openable", part_of="unit", movable=False)
        for n in (1, 2)
    ]
    drawers[1] = msgspec.structs.replace(drawers[1], blocked_by=("drawer_1",))
    unit = thing("unit", "dresser", "supports", movable=False, home="kitchen")
    robots = (able(manipulator("hsr")),)
    holds = fact("hsr", "holding", "nothing")
    world = WorldModel.of(SKILLS, PLACES, (unit, *drawers, thing("cup", "cup")), robots, (holds,))
    goal = Goal(goal="g", text="g", ordinal=1, conditions=(condition("held", "cup", True),))
    searched = frozenset(place.place for place in PLACES)
    problem = PlanningProblem(plan="p", goals=(goal,), world=world, searched=searched)
    made = SymbolicPlanner().plan(problem)
    assert isinstance(made, CheckedPlan), made
    tasks = {(t.skill, t.args.get("thing") or t.args.get("container")): t for t in made.plan.tasks}
    assert "close" not in skills(made.plan)
    looked = tasks["look_into", "drawer_2"].task
    assert looked in ancestors(made.plan, tasks["open", "drawer_1"].task)


def test_a_door_is_closed_again_behind_what_was_put_in() -> None:
    closed = fact("fridge", "is_open", value=False)  # type: ignore[arg-type]
    wanted = (condition("in", "milk", "fridge"), condition("is_open", "fridge", False))
    plan = planned(kitchen(closed), *wanted)
    assert skills(plan)[-1] == "close"
    assert {"open", "place_in"} <= set(skills(plan))


def test_what_is_undone_on_the_way_is_made_true_again() -> None:
    wanted = (condition("clean", "cup", True), condition("in", "cup", "cupboard"))
    plan = planned(kitchen(), *wanted)
    order = skills(plan)
    assert order.index("wash") < len(order) - 1
    assert order[-1] == "place_in"
    assert plan.tasks[-1].args["into"] == "cupboard"


def test_what_one_condition_leaves_in_a_hand_is_there_for_the_next() -> None:
    plan = planned(kitchen(), condition("level", "jug", 3), at("jug", "hallway"))
    assert skills(plan).count("fill") == 1
    assert set(plan.conditions) == {condition("level", "jug", 3), at("jug", "hallway")}


def test_numbers_are_counted() -> None:
    plan = planned(kitchen(), condition("watered", "plant", True))
    order = skills(plan)
    assert order.index("fill") < order.index("water")
    filled = kitchen(fact("jug", "level", value=1))  # type: ignore[arg-type]
    assert "fill" not in skills(planned(filled, condition("watered", "plant", True)))


@pytest.mark.parametrize(("wanted", "times"), [(2, 2), (5, 5), (-1, None)])
def test_a_number_is_counted_to(wanted: int, times: int | None) -> None:
    drip = {
        "parameters": {"robot": "robot", "jug": "jug"},
        "before": ["holding(robot) = jug"],
        "after": ["level(jug) += 1"],
        "duration_s": 5,
    }
    own = {**SKILLS, **skills_from_data({"skills": {"drip": drip}}, "own.yaml")}
    world = WorldModel.of(
        own,
        PLACES,
        (thing("jug", "jug"),),
        (able(manipulator("hsr"), "drip"),),
        (
            Fact(subject="jug", relation="level", value=0, source="test"),
            fact("jug", "at", "kitchen"),
            fact("hsr", "holding", "nothing"),
        ),
    )
    found = made(world, condition("level", "jug", wanted))
    assert isinstance(found, CheckedPlan) is (times is not None)
    if isinstance(found, CheckedPlan):
        assert skills(found.plan).count("drip") == times
    else:
        assert not found.postponed, "it only ever becomes more"


def test_a_robot_that_cannot_drive_acts_where_it_stands() -> None:
    fixed = msgspec.structs.replace(
        manipulator(),
        skills=("pick", "place_on_robot"),
        capabilities={"see": 4.0, "grip": 1.0, "reach": 1.0},
    )
    world = home((fixed, carrier()), facts=(fact("hsr", "at", "kitchen"),))
    plan = planned(world, at("cup_1", "hallway"))
    assert [t.skill for t in plan.tasks if t.skill != "navigate"] == ["pick", "place_on_robot"]


@pytest.mark.parametrize("room", ["kitchen", "living_room"])
def test_robots_that_cannot_drive_are_not_taken_for_one_another(room: str) -> None:
    fixed = [
        msgspec.structs.replace(
            manipulator(name),
            skills=("pick", "place_on_robot"),
            capabilities={"see": 4.0, "grip": 1.0, "reach": 1.0},
        )
        for name in ("arm_1", "arm_2")
    ]
    stand = (fact("arm_1", "at", "kitchen"), fact("arm_2", "at", "living_room"))
    there = (fact("cup_1", "at", room),)
    world = home((*fixed, carrier()), cups=1, facts=(*stand, *there))
    plan = planned(world, at("cup_1", "hallway"))
    assert [t.skill for t in plan.tasks if t.skill != "navigate"] == ["pick", "place_on_robot"]


HEAVY = Object(object="cup_1", kind="cup", label="cup", mass_kg=9.0)


@pytest.mark.parametrize(
    ("world", "wanted", "missing"),
    [
        (kitchen(), at("television", "hallway"), "is for movable, and television is none"),
        (
            kitchen(),
            condition("on", "cup", "television"),
            "for supports, and television is none",
        ),
        (home(), at("cup_1", "garden"), "nobody knows of a place garden"),
        (home(), condition("shiny", "cup_1", True), "no skill makes shiny(cup_1) = true"),
        (home((carrier(),)), at("cup_1", "hallway"), "locobot does not have the skill place"),
        (
            WorldModel.of(
                SKILLS, PLACES, (HEAVY,), (manipulator(),), (fact("cup_1", "at", "kitchen"),)
            ),
            at("cup_1", "hallway"),
            "cup_1 weighs 9 kg; hsr lifts 1.2 kg",
        ),
    ],
)
def test_what_is_missing_first_is_said(world: WorldModel, wanted: Condition, missing: str) -> None:
    refused = made(world, wanted)
    assert isinstance(refused, NoPlan)
    assert not refused.postponed
    assert missing in refused.reason


def test_giving_up_is_no_no() -> None:
    world = rooms(60)
    given_up = made(world, at("cup_1", "room_59"), steps=3)
    assert isinstance(given_up, NoPlan)
    assert given_up.postponed
    assert "impossible" not in given_up.reason
    assert "no sequence" not in given_up.reason


def test_of_a_goal_for_one_of_many_the_nearest_is_taken() -> None:
    some = Condition(
        relation="at",
        subject="cup_1",
        any_of=tuple(f"cup_{n}" for n in range(1, 7)),
        value="hallway",
    )
    world = home(
        cups=6, facts=(fact("cup_4", "at", "living_room"), fact("hsr", "at", "living_room"))
    )
    plan = planned(world, some)
    assert {t.args["object"] for t in plan.tasks if "object" in t.args} == {"cup_4"}


def ways_to(world: WorldModel, wanted: Condition, **way: tuple[Condition, ...]) -> object:
    budget = TimeBudget(float(FEW_STEPS), StepClock(1.0))
    found = alternatives_for(
        Subgoal("g", wanted), dict(world.facts), world, budget, on_the_way=Trajectory(**way)
    )
    return found[0] if isinstance(found, tuple) else found


def test_what_must_never_be_is_not_passed_through() -> None:
    opened = condition("is_open", "cupboard", True)
    held = condition("held", "cup", True)
    assert isinstance(ways_to(kitchen(), held), tuple)
    assert isinstance(ways_to(kitchen(), held, never=(opened,)), Impossible)
    shut = condition("is_open", "cupboard", False)
    closed = kitchen(fact("cupboard", "is_open", value=False))  # type: ignore[arg-type]
    assert isinstance(ways_to(closed, held, always=(shut,)), Impossible)
    ways = ways_to(closed, at("milk", "kitchen"), always=(shut,), never=(at("hsr", "hallway"),))
    assert isinstance(ways, tuple)
    assert all(action.actor != "hsr" for way in ways for action in way.actions)
