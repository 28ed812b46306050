"""A goal is deleted while its thing is in a hand: the thing is put down first."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fleet.core import events
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.requests import Control, ControlRequest
from keyexpr_schema.payloads.tasks import Order, ReportState
from keyexpr_schema.payloads.world import Surface
from tests.support.fleet_model import FleetModel, fleet
from tests.support.household import PLACES, bring, carrier, manipulator


def until_ordered(model: FleetModel, skill: str) -> Order:
    while not (found := [order for order in model.wanted() if order.skill == skill]):
        model.succeed(model.wanted()[0])
    return found[0]


def value(model: FleetModel, relation: str, subject: str) -> object:
    fact = model.state.fact(relation, subject)
    return fact and fact.value


@pytest.mark.parametrize("home", [None, "living_room"])
def test_it_is_put_down_at_home_or_on_the_nearest_surface_and_that_is_said(
    home: str | None,
) -> None:
    model = fleet()
    model.receive(events.ObjectPut, object=replace(model.state.objects["cup_1"], home=home))
    top = Surface(surface="top", x_m=0.0, y_m=0.0, z_m=0.7, yaw_rad=0.0, length_m=1.0, width_m=1.0)
    for place in PLACES[1:]:
        model.receive(events.PlacePut, place=replace(place, surfaces=(top,)))
    model.plan(bring(1, "hallway"))
    drive = until_ordered(model, "pick")
    model.succeed(drive)
    (drive,) = model.wanted()
    assert (drive.skill, value(model, "holding", "hsr")) == ("navigate", "cup_1")
    model.receive(events.GoalDeleted, goal="g1")
    status = model.goal_states["put-down-cup_1"]
    assert status.note == "goal g1 was deleted while cup_1 was in the hand of hsr"
    assert model.plans["plan-1"].cancelling or model.plans["plan-1"].ended
    model.crash()
    model.finish_cancelling()
    assert value(model, "at", "cup_1") == (home or "hallway")
    assert value(model, "holding", "hsr") == "nothing"
    assert model.goal_state("put-down-cup_1") is GoalState.REACHED
    assert model.state.to_put_down == {} and "g1" not in model.goal_states


def test_the_plan_of_other_goals_says_why_it_is_made_again() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"), bring(2, "hallway"))
    model.succeed(until_ordered(model, "pick"))
    held = str(value(model, "holding", "hsr"))
    goal = f"g{held[-1]}"
    model.late = True
    model.receive(events.GoalDeleted, goal=goal)
    entry = model.state.plans["plan-1"]
    assert entry.replan is not None
    assert f"goal {goal} was deleted while {held} was in the hand" in {
        reason.sentence for reason in entry.reasons
    }
    model.finish_cancelling()
    assert {s.state for s in model.goal_states.values()} == {GoalState.REACHED}
    assert value(model, "holding", "hsr") == "nothing"


@pytest.mark.parametrize("taken", [True, False])
def test_what_is_just_being_taken_is_put_down_if_it_is_in_the_hand_then(taken: bool) -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    pick = until_ordered(model, "pick")
    model.start(pick)
    model.receive(events.GoalDeleted, goal="g1")
    assert "put-down-cup_1" not in model.goal_states
    if taken:
        model.report(pick, ReportState.CANCELLED, facts=model.facts_after(pick))
    else:
        model.cancelled(pick)
    assert ("put-down-cup_1" in model.goal_states) is taken
    model.finish()
    assert value(model, "holding", "hsr") == "nothing"
    assert value(model, "at", "cup_1") == "kitchen"


def test_what_another_goal_wants_stays_in_the_hand() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.succeed(until_ordered(model, "pick"))
    other = replace(bring(1, "living_room"), goal="other")
    model.receive(events.GoalPut, goal=other)
    model.receive(events.GoalDeleted, goal="g1")
    assert "put-down-cup_1" not in model.goal_states
    model.plan()
    model.finish_cancelling()
    assert model.goal_state("other") is GoalState.REACHED
    assert value(model, "at", "cup_1") == "living_room"


def test_a_goal_of_the_planners_own_can_be_taken_back() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.succeed(until_ordered(model, "pick"))
    model.receive(events.GoalDeleted, goal="g1")
    model.receive(events.GoalDeleted, goal="put-down-cup_1")
    model.finish_cancelling()
    assert value(model, "holding", "hsr") == "cup_1" and not model.goal_states


def left_in_the_hand_of_a_cancelled_plan() -> FleetModel:
    """The cup of a deleted goal is to be put down by a plan of others, and that is cancelled."""
    model = fleet()
    model.plan(bring(1, "hallway"), bring(2, "hallway"))
    model.succeed(until_ordered(model, "pick"))
    held = str(value(model, "holding", "hsr"))
    model.receive(events.GoalDeleted, goal=f"g{held[-1]}")
    model.late = True
    request = ControlRequest(request="stop", control=Control.CANCEL, plan="plan-1")
    model.receive(events.ControlRequested, request=request)
    for order in model.orders():
        if order.cancelled:
            model.cancelled(order)
    return model


def test_it_is_put_down_also_where_the_plan_that_was_to_do_so_is_cancelled() -> None:
    model = left_in_the_hand_of_a_cancelled_plan()
    held = str(value(model, "holding", "hsr"))
    assert model.plans["plan-1"].ended
    while model.answers:
        model.answer()
    model.finish()
    assert value(model, "holding", "hsr") == "nothing"
    assert model.goal_state(f"put-down-{held}") is GoalState.REACHED


def test_what_has_been_put_down_meanwhile_is_not_fetched_again() -> None:
    model = fleet()
    model.late = True
    model.plan(bring(2, "hallway"))
    model.learn("hsr", "holding", "cup_1")
    model.learn("cup_1", "at", "hsr")
    left = model.state.to_put_down.set("cup_1", "goal g1 was deleted")
    model.state = replace(model.state, to_put_down=left)
    model.learn("cup_2", "at", "kitchen")
    assert model.goal_state("put-down-cup_1") is GoalState.WAITING
    model.learn("hsr", "holding", "nothing")
    model.learn("cup_1", "at", "living_room")
    assert model.goal_state("put-down-cup_1") is GoalState.NOT_NEEDED


def test_what_a_cancelled_program_of_several_calls_has_taken_is_put_down() -> None:
    """Somebody says that the cup is handed over, while a robot is still about to take it."""
    model = FleetModel((manipulator(), carrier(), manipulator("r2")), cups=3)
    goals = (bring(1, "living_room"), bring(2, "living_room"), bring(3, "hallway"))
    model.plan(*goals, programs=True)
    records = model.state.plans["plan-1"].records.values()
    (handover,) = (record for record in records if record.skill == "place_on_robot")
    (taking,) = (order for order in model.wanted() if order.task in handover.after[:1])
    assert taking.program is not None
    assert [step.skill for step in taking.program.steps] == ["navigate", "pick"]
    done = ControlRequest(
        request="by-hand", control=Control.TASK_DONE, plan="plan-1", task=handover.task
    )
    model.receive(events.ControlRequested, request=done)
    assert taking not in model.wanted() and taking.robot in {o.robot for o in model.orders()}
    model.finish()
    assert value(model, "holding", taking.robot) == "nothing"
    assert not model.state.goal_states


def test_what_a_goal_that_failed_leaves_in_a_hand_is_put_down_once_it_is_known_again() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.succeed(until_ordered(model, "pick"))
    thing = model.state.objects["cup_1"]
    model.receive(events.ObjectDeleted, object="cup_1")
    for order in model.orders():
        if order.cancelled:
            model.cancelled(order)
        else:
            model.fail(order, "nobody knows of cup_1", retryable=False)
    assert not model.state.goal_states and value(model, "holding", "hsr") == "cup_1"
    model.receive(events.ObjectPut, object=thing)
    model.finish()
    assert value(model, "holding", "hsr") == "nothing"
    assert model.goal_state("put-down-cup_1") is GoalState.REACHED


def left_in_the_hand(model: FleetModel) -> str:
    """The goal of a thing in a hand is deleted, while there are others; what is to be put down."""
    model.plan(bring(1, "hallway"), bring(2, "hallway"))
    model.succeed(until_ordered(model, "pick"))
    held = str(value(model, "holding", "hsr"))
    model.late = True
    model.receive(events.GoalDeleted, goal=f"g{held[-1]}")
    return f"put-down-{held}"


def test_it_is_not_forgotten_with_a_plan_that_it_was_to_go_into() -> None:
    model = fleet()
    goal = left_in_the_hand(model)
    assert goal not in model.state.plans["plan-1"].plan.goals
    request = ControlRequest(request="stop", control=Control.CANCEL, plan="plan-1")
    model.receive(events.ControlRequested, request=request)
    model.finish_cancelling()
    assert value(model, "holding", "hsr") == "nothing"
    assert model.goal_state(goal) is GoalState.REACHED


def test_it_is_not_given_up_but_tried_again_when_its_robot_has_been_charged() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.succeed(until_ordered(model, "pick"))
    model.receive(events.GoalDeleted, goal="g1")
    for order in model.orders():
        if order.cancelled:
            model.cancelled(order)
    for _ in range(6):
        model.fail(until_ordered(model, "place"))
    status = model.state.goal_states["put-down-cup_1"]
    assert status.state is GoalState.WAITING and "6 failed tasks" in (status.reason or "")
    assert not model.orders()
    model.learn("hsr", "charge", 40)
    model.finish()
    assert model.goal_state("put-down-cup_1") is GoalState.REACHED


def test_it_does_not_wait_for_a_plan_that_somebody_has_paused() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"), bring(2, "hallway"))
    model.succeed(until_ordered(model, "pick"))
    held = str(value(model, "holding", "hsr"))
    hold = Hold(hold="lunch", kind=HoldKind.PAUSE, plans=("plan-1",))
    model.receive(events.HoldPut, hold=hold)
    model.receive(events.GoalDeleted, goal=f"g{held[-1]}")
    model.finish_cancelling()
    assert model.goal_state(f"put-down-{held}") is GoalState.REACHED
    assert not model.state.plans["plan-1"].ended
