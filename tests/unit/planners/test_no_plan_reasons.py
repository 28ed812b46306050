"""What is said where there is no plan: what is missing first, and nothing that leads astray."""

from __future__ import annotations

import msgspec
import pytest

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.skills import SkillModel
from fleet.core.model.world import WorldModel
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.payloads.goals import Condition, Goal, Precedence
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Object, Place, Surface
from tests.support.household import PLACES, SKILLS, at, fact, manipulator

RULES = {
    "lock_up": {
        "parameters": {"robot": "robot", "place": "place"},
        "before": ["at(robot) = place", "all(x: openable, is_open(x) = false)"],
        "after": ["locked(place) = true"],
        "duration_s": 5,
    },
    "serve": {
        "parameters": {"robot": "robot", "table": "table", "place": "place"},
        "before": ["at(table) = place", "count(x: dish, on(x) = table) >= 2"],
        "after": ["served(table) = true"],
        "duration_s": 5,
    },
    "play": {
        "parameters": {"robot": "robot", "place": "place"},
        "before": ["at(robot) = place", "any(x: piano, is_open(x) = true)"],
        "after": ["played(place) = true"],
        "duration_s": 5,
    },
}
ALL: dict[str, SkillModel] = {**SKILLS, **skills_from_data({"skills": RULES}, "rules.yaml")}
ARM = msgspec.structs.replace(manipulator(), skills=tuple(ALL))
FIXED = msgspec.structs.replace(
    ARM,
    skills=tuple(name for name in ALL if name != "navigate"),
    capabilities={"see": 4.0, "grip": 1.2, "reach": 1.0},
)


def thing(name: str, kind: str, *features: str, **more: object) -> Object:
    return Object(object=name, kind=kind, label=name, features=features, **more)  # type: ignore[arg-type]


CUP = thing("cup", "cup", categories=("dish",))
PLATE = thing("plate", "plate", categories=("dish",))
BOX = thing("box", "box", "contains", "openable")
TABLE = thing("table", "table", "supports", movable=False, home="kitchen", room=1)
ANNA = thing("anna", "person", "person", movable=False, room=1)


def asked(
    goal: Goal,
    objects: tuple[Object, ...],
    *facts: tuple[str, str, str | None],
    robots: tuple[RobotSpec, ...] = (ARM,),
    places: tuple[Place, ...] = PLACES,
    available: tuple[str, ...] | None = None,
) -> CheckedPlan | NoPlan:
    known = [fact(*row) for row in facts]
    known += [fact(r.robot, "at", "kitchen") for r in robots]
    held = {row[0] for row in facts if row[1] == "holding"}
    known += [fact(r.robot, "holding", "nothing") for r in robots if r.robot not in held]
    world = WorldModel.of(ALL, places, objects, robots, known, available)
    return SymbolicPlanner().plan(PlanningProblem("p", (goal,), world))


def goal(*conditions: Condition, **more: object) -> Goal:
    return Goal(goal="g", text="", conditions=conditions, **more)  # type: ignore[arg-type]


def state(relation: str, subject: str, value: str | bool) -> Condition:
    return Condition(relation=relation, subject=subject, value=value)


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        (at("hsr", "table"), "hsr cannot drive to table, which is an object"),
        (state("played", "kitchen", True), "any(x: piano, is_open(x) = true) never holds"),
    ],
)
def test_what_cannot_be_is_said_in_the_words_of_who_asked(wanted: Condition, said: str) -> None:
    found = asked(goal(wanted), (CUP, TABLE), ("cup", "at", "kitchen"))
    assert isinstance(found, NoPlan)
    assert found.reason.endswith(said)


def test_a_robot_that_cannot_drive_is_not_missing_a_second_one() -> None:
    found = asked(goal(at("cup", "kitchen")), (CUP,), ("cup", "at", "hallway"), robots=(FIXED,))
    assert isinstance(found, NoPlan)
    assert "to at(cup) = kitchen: hsr cannot drive, and is at kitchen" in found.reason


def test_a_robot_that_is_away_is_not_said_to_be_unable() -> None:
    other = msgspec.structs.replace(ARM, robot="hsr_2")
    facts = (("cup", "at", "kitchen"),)
    wanted = goal(at("hsr_2", "hallway"))
    found = asked(wanted, (CUP,), *facts, robots=(ARM, other), available=("hsr",))
    assert isinstance(found, NoPlan)
    assert found.reason.endswith("at(hsr_2) = hallway: hsr_2 is not there")


def test_what_a_robot_has_that_is_away_is_said_to_be_there() -> None:
    other = msgspec.structs.replace(ARM, robot="hsr_2")
    facts = ("cup", "at", "hsr_2"), ("hsr_2", "holding", "cup")
    found = asked(
        goal(at("cup", "kitchen")), (CUP,), *facts, robots=(ARM, other), available=("hsr",)
    )
    assert isinstance(found, NoPlan)
    assert found.reason.endswith("hsr_2 has cup, and is not connected")


def test_a_hand_that_is_full_is_named_with_what_it_holds() -> None:
    facts = ("cup", "at", "anna"), ("plate", "at", "kitchen"), ("anna", "at", "kitchen")
    found = asked(goal(at("plate", "anna")), (CUP, PLATE, ANNA), *facts)
    assert isinstance(found, NoPlan)
    assert found.reason.endswith("anna has room for 1, taken up by cup")


@pytest.mark.parametrize(("always", "word"), [(True, "always hold, and does not"), (False, "")])
def test_what_is_broken_before_anything_is_done_is_said_first(always: bool, word: str) -> None:
    rule = (at("plate", "hallway" if always else "kitchen"),)
    wanted = goal(at("cup", "hallway"), **{"always" if always else "never": rule})
    found = asked(wanted, (CUP, PLATE), ("cup", "at", "kitchen"), ("plate", "at", "kitchen"))
    assert isinstance(found, NoPlan)
    assert found.reason == f"{rule[0]} must {word or 'never hold, and does'} at the start"


def test_what_may_not_be_yet_is_not_said_to_be_forbidden_for_ever() -> None:
    there = at("cup", "hallway")
    found = asked(
        goal(there, sometime_before=(Precedence(first=there, then=there),)),
        (CUP,),
        ("cup", "at", "kitchen"),
    )
    assert isinstance(found, NoPlan)
    assert "leads to at(cup) = hallway, which must not hold yet" in found.reason


@pytest.mark.parametrize(
    ("wanted", "objects", "facts"),
    [
        (at("cup", "hallway"), (CUP, BOX), (("cup", "at", "box"),)),
        (state("locked", "kitchen", True), (BOX,), ()),
        (state("served", "table", True), (CUP, PLATE, TABLE), (("cup", "at", "table"),)),
    ],
    ids=["what is in it", "what is said of all", "what is counted"],
)
def test_what_nobody_knows_the_place_of_is_looked_for(
    wanted: Condition, objects: tuple[Object, ...], facts: tuple[tuple[str, str, str], ...]
) -> None:
    objects = tuple(msgspec.structs.replace(o, room=None) for o in objects)
    found = asked(goal(wanted), objects, *facts)
    assert isinstance(found, CheckedPlan), found.reason
    assert {task.skill for task in found.plan.tasks} == {"navigate", "search"}


def test_a_world_without_places_is_no_endless_search() -> None:
    found = asked(goal(state("held", "cup", True)), (CUP,), places=())
    assert isinstance(found, NoPlan)
    assert "nobody knows where cup is" in found.reason


def test_of_conditions_that_exclude_each_other_all_are_named() -> None:
    """And not one of them, as if only that did not hold when some plan is done."""
    boxes = thing("one", "box", "contains"), thing("two", "box", "contains")
    facts = ("one", "at", "kitchen"), ("two", "at", "kitchen")
    found = asked(goal(state("in", "one", "two"), state("in", "two", "one")), boxes, *facts)
    assert isinstance(found, NoPlan)
    assert "to in(one) = two and in(two) = one: every way to" in found.reason


LOCOBOT = msgspec.structs.replace(
    ARM,
    robot="locobot",
    model="locobot",
    capabilities={"drive": 0.5, "see": 4.0, "grip": 0.3, "reach": 0.4},
)


def high(place: Place) -> Place:
    """The same place with a shelf that few robots reach."""
    shelf = Surface(
        surface="shelf", x_m=0.0, y_m=0.0, z_m=2.0, yaw_rad=0.0, length_m=1.0, width_m=0.3
    )
    return msgspec.structs.replace(place, surfaces=(shelf,))


def test_what_is_too_heavy_is_said_with_what_each_robot_lifts() -> None:
    heavy = msgspec.structs.replace(CUP, mass_kg=1.5)
    facts = (("cup", "at", "kitchen"),)
    found = asked(goal(at("cup", "hallway")), (heavy,), *facts, robots=(ARM, LOCOBOT))
    assert isinstance(found, NoPlan)
    assert found.reason.endswith(": cup weighs 1.5 kg; hsr lifts 1.2 kg, locobot 0.3 kg")


def test_what_is_too_high_is_said_with_how_far_each_robot_reaches() -> None:
    places = tuple(high(place) if place.place == "hallway" else place for place in PLACES)
    facts = (("cup", "at", "hallway"),)
    found = asked(goal(at("cup", "kitchen")), (CUP,), *facts, robots=(ARM, LOCOBOT), places=places)
    assert isinstance(found, NoPlan)
    said = "the highest surface in hallway is at 2 m; hsr reaches 1 m, locobot 0.4 m"
    assert found.reason.endswith(f": {said}")


def test_a_goal_that_wants_two_things_that_cannot_be_both_names_them() -> None:
    both = goal(at("cup", "hallway"), at("cup", "kitchen"))
    found = asked(both, (CUP,), ("cup", "at", "hallway"))
    assert isinstance(found, NoPlan)
    assert found.reason == (
        "goal g wants at(cup) = hallway and at(cup) = kitchen, which cannot both hold"
    )
    table = goal(at("cup", "table"), at("cup", "kitchen"))
    facts = ("cup", "at", "hallway"), ("table", "at", "kitchen")
    assert isinstance(asked(table, (CUP, TABLE), *facts), CheckedPlan)


def test_what_another_goal_keeps_from_being_is_said_with_its_name() -> None:
    world = WorldModel.of(
        ALL,
        PLACES,
        (CUP,),
        (ARM,),
        [
            fact("cup", "at", "kitchen"),
            fact("hsr", "at", "kitchen"),
            fact("hsr", "holding", "nothing"),
        ],
    )
    never = at("cup", "hallway")
    wanted = goal(at("cup", "hallway"), never=(never,))
    problem = PlanningProblem("p", (wanted,), world, keepers={str(never): "keep-clear"})
    found = SymbolicPlanner().plan(problem)
    assert isinstance(found, NoPlan)
    assert found.reason.endswith("at(cup) = hallway must never hold, as goal keep-clear wants")


def test_a_planner_without_the_strategy_says_which_ones_it_has() -> None:
    world = WorldModel.of(ALL, PLACES, (CUP,), (ARM,), [])
    problem = PlanningProblem("p", (goal(at("cup", "hallway")),), world, strategy="greedy")
    found = SymbolicPlanner().plan(problem)
    assert isinstance(found, NoPlan)
    assert found.reason == (
        "planner symbolic has no strategy greedy: choose one of big-dag, per-goal, monolithic, "
        "least-work"
    )
