"""Goals that are begun later: when their time has come, when something holds, if something does."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fleet.core import events
from fleet.core.events import decode_event
from fleet.core.step import replay
from keyexpr_schema.payloads.goals import Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.requests import PlanRequest
from tests.support.fleet_model import FleetModel, fleet
from tests.support.household import at

HALLWAY = at("cup_1", "hallway")
NOON = "2026-05-01T12:00:00+02:00"


def put(model: FleetModel, text: str = "Bring cup 1 to the hallway", **more: object) -> GoalStatus:
    said_s = model.time_s + 1.0
    goal = Goal(goal="g", text=text, said_s=said_s, **more)  # type: ignore[arg-type]
    model.receive(events.GoalPut, goal=goal)
    return model.goal_states["g"]


def wait(model: FleetModel, seconds: float) -> None:
    model.time_s += seconds
    model.receive(events.TimerFired)


def test_what_is_for_later_is_begun_then_without_being_asked_for() -> None:
    model = fleet()
    status = put(model, "Bring cup 1 to the hallway in ten minutes")
    assert status.state is GoalState.PENDING
    assert status.next_s == model.time_s + 600.0
    assert "it is begun at" in (status.reason or "")
    wait(model, 590.0)
    assert (model.goal_state("g"), model.plans) == (GoalState.PENDING, {})
    wait(model, 10.0)
    assert model.goal_state("g") is GoalState.RUNNING
    model.finish()
    assert model.goal_state("g") is GoalState.REACHED
    assert not model.state.waiting_for_robots


def test_a_time_of_day_is_of_the_clock_that_was_brought() -> None:
    status = put(fleet(), "Bring cup 1 to the hallway at 5 pm", said_at=NOON)
    assert status.next_s is not None
    assert status.given_s is not None
    assert status.next_s - status.given_s == 5 * 3600.0
    assert status.reason == "it is begun at 17:00"


@pytest.mark.parametrize("shown", [None, "noon", "2026-05-01T12:00:00"])
def test_a_time_of_day_without_a_clock_is_refused(shown: str | None) -> None:
    status = put(fleet(), "Bring cup 1 to the hallway at 5 pm", said_at=shown)
    assert status.state is GoalState.REJECTED
    said = "what time it is now" if shown is None else "no time with an offset"
    assert said in (status.reason or "")


def test_a_goal_waits_until_what_it_waits_for_holds() -> None:
    model = fleet()
    status = put(model, "When cup 2 is in the hallway, bring cup 1 to the hallway")
    assert (status.state, status.reason) == (
        GoalState.PENDING,
        "it waits until cup 2 is in the hallway",
    )
    model.learn("cup_2", "at", "living_room")
    assert model.goal_state("g") is GoalState.PENDING
    model.learn("cup_2", "at", "hallway")
    model.finish()
    assert model.goal_state("g") is GoalState.REACHED


def test_a_goal_that_waits_for_what_holds_already_is_as_any_other() -> None:
    model = fleet()
    put(model, when=(at("cup_2", "kitchen"),))
    assert (model.goal_state("g"), model.plans) == (GoalState.WAITING, {})


def test_if_it_does_not_hold_the_goal_is_over_at_once() -> None:
    model = fleet()
    status = put(model, "If cup 2 is in the hallway, bring cup 1 to the hallway")
    assert status.state is GoalState.NOT_NEEDED
    assert status.reason == "it is not needed, since it is not so that cup 2 is in the hallway"
    assert "g" not in model.state.goals


def test_if_it_holds_the_goal_is_as_any_other() -> None:
    model = fleet()
    put(model, "If cup 2 is in the kitchen, bring cup 1 to the hallway")
    assert model.goal_state("g") is GoalState.WAITING
    model.plan()
    model.finish()
    assert model.goal_state("g") is GoalState.REACHED


@pytest.mark.parametrize(
    ("found", "becomes"), [("hallway", GoalState.RUNNING), ("kitchen", GoalState.NOT_NEEDED)]
)
def test_if_nobody_knows_it_waits_to_be_told(found: str, becomes: GoalState) -> None:
    model = fleet()
    model.learn("cup_2", "at", None)
    status = put(model, "If cup 2 is in the hallway, bring cup 1 to the hallway")
    assert status.state is GoalState.PENDING
    assert "nobody knows whether cup 2 is in the hallway" in (status.reason or "")
    model.learn("cup_2", "at", found)
    assert model.goal_state("g") is becomes


def test_whether_it_is_needed_is_asked_when_its_time_has_come() -> None:
    model = fleet()
    put(model, "If cup 2 is in the hallway, bring cup 1 to the hallway in ten minutes")
    assert model.goal_state("g") is GoalState.PENDING
    model.learn("cup_2", "at", "hallway")
    wait(model, 600.0)
    assert model.goal_state("g") is GoalState.RUNNING


def test_nobody_can_have_it_planned_before() -> None:
    model = fleet()
    put(model, not_before_s=500.0)
    model.receive(events.PlanRequested, request=PlanRequest(request="r", goals=("g",)))
    assert not model.replies["r"].accepted
    assert "is pending: it is begun at 500 s" in model.replies["r"].sentence
    model.receive(events.PlanRequested, request=PlanRequest(request="all"))
    assert "no goal that waits" in model.replies["all"].sentence


def test_what_is_put_again_for_later_leaves_its_plan() -> None:
    model = fleet()
    goal = Goal(goal="g", text="Bring cup 1 to the hallway")
    model.plan(goal)
    assert model.orders()
    model.receive(events.GoalPut, goal=replace(goal, not_before_s=9000.0))
    model.finish_cancelling()
    assert model.goal_state("g") is GoalState.PENDING
    assert not model.state.index.plans_of
    wait(model, 9000.0)
    model.finish()
    assert model.goal_state("g") is GoalState.REACHED


def test_pending_goals_can_be_deleted() -> None:
    model = fleet()
    put(model, not_before_s=500.0)
    model.receive(events.GoalDeleted, goal="g")
    wait(model, 600.0)
    assert not model.plans
    assert not model.state.goals


def test_a_planner_that_was_killed_goes_on_waiting() -> None:
    model = fleet()
    put(model, "Bring cup 1 to the hallway in ten minutes")
    model.crash()
    assert model.goal_state("g") is GoalState.PENDING
    wait(model, 600.0)
    model.finish()
    assert model.goal_state("g") is GoalState.REACHED
    assert replay(map(decode_event, model.journal)) == model.state


def test_a_clock_that_is_set_back_leaves_as_long_to_wait() -> None:
    model = fleet()
    model.time_s = 10_000.0
    put(model, "Bring cup 1 to the hallway in ten minutes")
    model.time_s = 0.0
    model.receive(events.TimerFired)
    status = model.goal_states["g"]
    assert status.next_s == model.time_s + 600.0
    wait(model, 598.0)
    assert model.goal_state("g") is GoalState.PENDING
    wait(model, 2.0)
    assert model.goal_state("g") is GoalState.RUNNING
