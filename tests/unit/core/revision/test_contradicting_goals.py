"""Goals that cannot all be reached together: each has the reason that is its own."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from keyexpr_schema.payloads.goals import Goal, GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import ReplanRequest
from tests.support.fleet_model import FleetModel, fleet
from tests.support.household import at, bring

KITCHEN = replace(bring(1, "kitchen"), goal="g9", ordinal=9)
AGAINST_G9 = (
    "it contradicts goal g9: at(cup_1) = hallway cannot hold together with at(cup_1) = kitchen"
)
AGAINST_G1 = (
    "it contradicts goal g1: at(cup_1) = kitchen cannot hold together with at(cup_1) = hallway"
)


def reasons(model: FleetModel) -> dict[str, str | None]:
    return {goal: status.reason for goal, status in model.goal_states.items()}


def test_a_person_who_asks_for_a_plan_of_them_hears_of_each_whom_it_contradicts() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"), KITCHEN, bring(2, "hallway"))
    assert model.plans["plan-1"].state is PlanState.REJECTED
    sentence = f"goal g1 cannot be planned: {AGAINST_G9}"
    assert model.replies["r0"].sentence == sentence
    assert reasons(model) == {"g1": AGAINST_G9, "g9": AGAINST_G1, "g2": sentence}


def test_one_that_contradicts_a_running_plan_waits_and_what_came_with_it_does_not() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.succeed(model.orders()[0])
    for goal in (KITCHEN, bring(2, "hallway")):
        model.receive(events.GoalPut, goal=goal)
    more = ReplanRequest(request="more", plan="plan-1", reason="more", goals=("g9", "g2"))
    model.receive(events.ReplanRequested, request=more)
    assert model.replies["more"].accepted
    assert model.replies["more"].sentence.endswith(f"goal g9 is left out: {AGAINST_G1}")
    model.finish()
    assert {g: s.state for g, s in model.goal_states.items()} == {
        "g1": GoalState.REACHED,
        "g2": GoalState.REACHED,
        "g9": GoalState.WAITING,
    }
    assert reasons(model)["g9"] == AGAINST_G1
    model.plan()  # now it can be done
    model.finish()
    assert model.goal_state("g9") is GoalState.REACHED


def test_the_more_urgent_of_two_is_planned() -> None:
    model = fleet()
    model.plan(bring(2, "hallway"))
    urgent = replace(KITCHEN, priority=5)
    for goal in (bring(1, "hallway"), urgent):
        model.receive(events.GoalPut, goal=goal)
    more = ReplanRequest(request="more", plan="plan-1", reason="more", goals=("g1", "g9"))
    model.receive(events.ReplanRequested, request=more)
    assert reasons(model) == {"g2": None, "g9": None, "g1": AGAINST_G9}


def test_one_that_another_must_never_have_names_it() -> None:
    model = fleet()
    never = replace(bring(2, "hallway"), goal="g9", never=bring(1, "hallway").conditions)
    model.plan(bring(1, "hallway"), never)
    assert reasons(model) == {
        "g1": "it contradicts goal g9: at(cup_1) = hallway cannot hold together with "
        "at(cup_2) = hallway and never at(cup_1) = hallway",
        "g9": "it contradicts goal g1: at(cup_2) = hallway and never at(cup_1) = hallway cannot "
        "hold together with at(cup_1) = hallway",
    }


def test_a_carrier_that_cannot_be_unloaded_cannot_leave_while_its_load_is_to_stay() -> None:
    model = fleet()
    model.learn("locobot", "at", "hallway")
    model.learn("cup_1", "at", "locobot")
    leave = Goal(goal="l", text="", conditions=(at("locobot", "kitchen"),), ordinal=5)
    model.plan(bring(1, "hallway"), leave)
    rows = ("at(cup_1) = hallway", "at(locobot) = kitchen")
    assert reasons(model) == {
        "g1": f"it contradicts goal l: {rows[0]} cannot hold together with {rows[1]}",
        "l": f"it contradicts goal g1: {rows[1]} cannot hold together with {rows[0]}",
    }
