"""Formulas, effects that depend, and what goals keep or avoid, while a plan is carried out."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fleet.core.model.skill_file import skills_from_data
from keyexpr_schema.facts import FactKey, Value
from keyexpr_schema.payloads.goals import Condition, Goal, GoalState, Precedence
from tests.support.fleet_model import FleetModel
from tests.support.household import SKILLS, at, bring, manipulator

OWN = skills_from_data(
    {
        "skills": {
            "fill": {
                "parameters": {"robot": "robot", "object": "cup", "place": "place"},
                "before": ["at(robot) = place", "at(object) = place", "level(object) < 2"],
                "after": ["level(object) += 1", "if level(object) >= 1: full(object) = true"],
            },
            "sweep": {
                "parameters": {"robot": "robot", "place": "place"},
                "before": ["at(robot) = place", "not any(x: movable, at(x) = place)"],
                "after": ["clean(place) = true"],
            },
        }
    },
    "here",
)
FULL = Condition(relation="full", subject="cup_1", value=True)
CLEAN = Condition(relation="clean", subject="hallway", value=True)


def model(robots: int = 1) -> FleetModel:
    team = tuple(
        replace(manipulator(f"r{n}"), skills=(*manipulator().skills, *OWN))
        for n in range(1, robots + 1)
    )
    made = FleetModel(team, cups=2, skills={**SKILLS, **OWN})
    made.learn("cup_1", "level", 0)
    return made


def wanting(condition: Condition, **more: tuple[Condition, ...]) -> Goal:
    return Goal(goal="g", text="do it", conditions=(condition,), **more)


def value(made: FleetModel, relation: str, subject: str) -> Value:
    return made.state.world().facts.get(FactKey(relation, subject))


def test_effects_depend_on_what_holds_when_the_task_ends() -> None:
    made = model()
    made.plan(wanting(FULL))
    seen = []
    while orders := made.orders():
        made.succeed(orders[0])
        if orders[0].skill == "fill":
            seen.append((value(made, "level", "cup_1"), value(made, "full", "cup_1")))
    assert seen == [(1, None), (2, True)]
    assert made.goal_state("g") is GoalState.REACHED


def test_a_task_whose_formula_does_not_hold_is_not_ordered() -> None:
    made = model()
    made.plan(wanting(FULL))
    while (order := made.orders()[0]).skill != "fill":
        made.succeed(order)
    made.succeed(order)
    made.learn("cup_1", "level", 0)  # somebody drank from it
    assert [o.skill for o in made.orders()] == ["fill"]
    made.finish()
    assert value(made, "level", "cup_1") == 2
    assert made.goal_state("g") is GoalState.REACHED


def test_a_fact_against_what_a_task_needs_of_all_things_leads_to_a_new_plan() -> None:
    made = model()
    made.plan(wanting(CLEAN))
    assert [o.skill for o in made.orders()] == ["navigate"]
    made.learn("cup_2", "at", "hallway")
    entry = made.plans["plan-1"]
    assert entry.plan.revision == 2
    assert "pick" in {task.skill for task in entry.plan.tasks}
    made.finish()
    assert made.goal_state("g") is GoalState.REACHED


def test_a_fact_about_what_is_elsewhere_is_not_against_it() -> None:
    made = model()
    made.plan(wanting(CLEAN))
    made.learn("cup_2", "at", "living_room")
    assert made.plans["plan-1"].plan.revision == 1


def test_what_the_plan_itself_takes_away_in_time_is_not_against_it() -> None:
    made = model()
    made.learn("cup_2", "at", "hallway")
    made.plan(wanting(CLEAN))
    made.learn("cup_2", "at", "hallway")
    made.finish()
    assert made.plans["plan-1"].plan.revision == 1
    assert made.goal_state("g") is GoalState.REACHED


@pytest.mark.parametrize(
    ("constraint", "sentence"),
    [
        ({"never": (at("cup_1", "hallway"),)}, "at(cup_1) = hallway must never hold"),
        ({"always": (at("cup_1", "kitchen"),)}, "at(cup_1) = kitchen must always hold"),
    ],
)
def test_no_plan_breaks_what_the_goal_keeps_or_avoids(
    constraint: dict[str, tuple[Condition, ...]], sentence: str
) -> None:
    made = model()
    made.plan(replace(bring(1, "hallway"), **constraint))
    assert not made.orders()
    assert sentence in made.replies["r0"].sentence


def test_a_goal_fails_when_somebody_else_breaks_what_it_keeps() -> None:
    made = model()
    kept = at("cup_2", "kitchen")
    made.plan(replace(bring(1, "hallway"), always=(kept,)))
    made.succeed(made.orders()[0])
    made.learn("cup_2", "at", "living_room")
    for order in made.orders():
        made.succeed(order)
    made.finish()
    status = made.goal_states["g1"]
    assert status.state is GoalState.FAILED
    assert "at(cup_2) = kitchen must always hold" in (status.reason or "")


def test_what_is_kept_holds_only_until_the_goal_is_reached() -> None:
    made = model()
    made.plan(replace(bring(1, "hallway"), always=(at("cup_2", "kitchen"),)))
    made.finish()
    assert made.goal_state("g1") is GoalState.REACHED
    made.plan(bring(2, "hallway"))
    made.finish()
    assert made.goal_state("g2") is GoalState.REACHED


def test_what_has_to_hold_before_the_goal_is_made_so_first() -> None:
    made = model()
    first = at("cup_1", "living_room")
    row = Precedence(first=first, then=at("cup_1", "hallway"))
    made.plan(replace(bring(1, "hallway"), sometime_before=(row,)))
    seen: list[str] = []
    while orders := made.orders():
        made.succeed(orders[0])
        seen.append(str(value(made, "at", "cup_1")))
    assert list(dict.fromkeys(seen)) == ["kitchen", "r1", "living_room", "hallway"]
    assert made.goal_states["g1"].passed == (first,)
    assert made.goal_state("g1") is GoalState.REACHED


def test_what_one_goal_does_waits_for_what_has_to_come_first_in_another() -> None:
    made = model(robots=2)
    row = Precedence(first=at("cup_2", "living_room"), then=at("cup_1", "hallway"))
    made.plan(replace(bring(1, "hallway"), sometime_before=(row,)), bring(2, "living_room"))
    order = []
    while orders := made.orders():
        # Whoever could bring the first cup does so as soon as that may be.
        done = next((o for o in orders if "cup_1" in o.args.values()), orders[0])
        made.succeed(done)
        order.append((done.skill, done.args.get("object")))
    assert order.index(("place", "cup_2")) < order.index(("place", "cup_1"))
    assert made.goal_state("g1") is made.goal_state("g2") is GoalState.REACHED


def test_what_is_not_wanted_is_avoided_or_comes_later() -> None:
    made = model()
    row = Precedence(first=at("cup_2", "hallway"), then=at("r1", "living_room"))
    made.plan(replace(bring(1, "hallway"), sometime_before=(row,)))
    assert len(made.plans["plan-1"].plan.tasks) == 4  # as without
    made.finish()
    assert made.goal_state("g1") is GoalState.REACHED
    made.learn("cup_1", "at", "living_room")
    made.plan(replace(bring(1, "kitchen"), goal="g5", sometime_before=(row,)))
    order = []
    while orders := made.orders():
        made.succeed(orders[0])
        order.append((orders[0].skill, tuple(orders[0].args.values())))
    assert ("place", ("r1", "cup_2", "hallway")) in order or any(
        skill == "place" and "cup_2" in args and "hallway" in args for skill, args in order
    )
    assert made.goal_state("g5") is GoalState.REACHED


def test_what_has_held_once_need_not_hold_again() -> None:
    made = model()
    first = at("cup_2", "living_room")
    row = Precedence(first=first, then=at("cup_1", "hallway"))
    made.plan(replace(bring(1, "hallway"), sometime_before=(row,)))
    while value(made, "at", "cup_2") != "living_room":
        made.succeed(made.orders()[0])
    made.learn("cup_2", "at", "kitchen")  # somebody takes it back
    assert made.goal_states["g1"].passed == (first,)
    made.finish()
    assert value(made, "at", "cup_2") == "kitchen"
    assert made.goal_state("g1") is GoalState.REACHED


def test_a_goal_fails_when_something_else_holds_too_early() -> None:
    made = model()
    row = Precedence(first=at("cup_1", "hallway"), then=at("cup_2", "living_room"))
    made.plan(replace(bring(1, "hallway"), sometime_before=(row,)))
    made.learn("cup_2", "at", "living_room")
    made.finish()
    status = made.goal_states["g1"]
    assert status.state is GoalState.FAILED
    assert "at(cup_1) = hallway must hold before at(cup_2) = living_room does" in (
        status.reason or ""
    )


def test_what_is_avoided_is_noticed_though_no_condition_is_about_it() -> None:
    made = model()
    made.plan(replace(bring(1, "hallway"), never=(at("cup_2", "living_room"),)))
    made.learn("cup_2", "at", "living_room")
    made.finish()
    assert made.goal_state("g1") is GoalState.FAILED
