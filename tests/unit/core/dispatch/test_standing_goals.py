"""Goals that make goals: schedules, what is kept, and texts that are several goals."""

from __future__ import annotations

import pytest

from fleet.core import events
from fleet.core.dispatch.standing.parts import RETRY_S
from fleet.core.events import decode_event
from fleet.core.step import replay
from keyexpr_schema.payloads.goals import Condition, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import Control, ControlRequest, PlanRequest
from tests.support.fleet_model import FleetModel, fleet
from tests.support.household import at, bring

NIGHT = "2026-05-01T06:00:00+02:00"
HOUR_S = 3600.0


def put(model: FleetModel, text: str, name: str = "g", **more: object) -> GoalStatus:
    said_s = model.time_s + 1.0
    goal = Goal(goal=name, text=text, said_s=said_s, said_at=NIGHT, **more)  # type: ignore[arg-type]
    model.receive(events.GoalPut, goal=goal)
    return model.goal_states[name]


def until(model: FleetModel, time_s: float) -> None:
    model.time_s = time_s - 1.0
    model.receive(events.TimerFired)


# --- schedules -----------------------------------------------------------------------------------


def daily(model: FleetModel) -> float:
    """A goal for every day at 7; the first time."""
    status = put(model, "Every day at 7, bring cup 1 to the hallway")
    assert status.state is GoalState.STANDING
    assert status.next_s == model.time_s + HOUR_S
    return status.next_s


def test_a_schedule_makes_a_goal_at_each_time() -> None:
    model = fleet()
    first_s = daily(model)
    until(model, first_s - 1.0)
    assert not model.plans
    until(model, first_s)
    status = model.goal_states["g"]
    assert (status.parts, status.runs, status.next_s) == (("g.1",), 1, first_s + 24 * HOUR_S)
    assert model.goal_states["g.1"].part_of == "g"
    model.finish()
    assert model.goal_state("g.1") is GoalState.REACHED
    assert model.goal_states["g"].parts == ()
    model.learn("cup_1", "at", "kitchen")
    until(model, first_s + 24 * HOUR_S)
    model.finish()
    assert model.goal_state("g.2") is GoalState.REACHED
    assert model.goal_state("g") is GoalState.STANDING


def test_times_that_were_missed_are_made_up_for_by_one_goal() -> None:
    model = fleet()
    first_s = daily(model)
    model.time_s = first_s + 3 * 24 * HOUR_S
    model.crash()
    model.finish()
    status = model.goal_states["g"]
    assert (status.runs, status.next_s) == (1, first_s + 4 * 24 * HOUR_S)
    assert model.goal_states["g.1"].note == "it is done once for 4 times that have passed"
    model.crash()
    model.receive(events.TimerFired)
    assert model.goal_states["g"].runs == 1, "done a second time"


def test_what_goes_on_is_not_begun_a_second_time() -> None:
    model = fleet()
    first_s = daily(model)
    until(model, first_s)
    assert model.orders()
    until(model, first_s + 24 * HOUR_S)
    status = model.goal_states["g"]
    assert (status.runs, status.parts) == (1, ("g.1",))
    assert status.next_s == first_s + 48 * HOUR_S


def test_a_period_begins_at_once() -> None:
    model = fleet()
    status = put(model, "Every two hours, bring cup 1 to the hallway")
    assert status.parts == ("g.1",)
    assert status.next_s is not None
    assert status.given_s is not None
    assert status.next_s - status.given_s == 2 * HOUR_S


def test_a_period_goes_on_where_its_seconds_are_rounded() -> None:
    model = fleet()
    start_s = 126_570_858.033
    model.time_s = start_s - 1.0
    put(model, "bring cup 1 to the hallway", every="P1D")
    model.finish()
    until(model, start_s + 467 * 24 * HOUR_S)
    status = model.goal_states["g"]
    assert (status.runs, status.next_s) == (2, start_s + 468 * 24 * HOUR_S)
    assert model.goal_states["g.2"].note == "it is done once for 467 times that have passed"


def test_a_goal_that_is_wanted_only_if_is_asked_for_at_each_time() -> None:
    model = fleet()
    first_s = daily(model)
    model.receive(events.GoalDeleted, goal="g")
    put(model, "Every day at 7, bring cup 1 to the hallway", only_if=(at("cup_2", "hallway"),))
    until(model, first_s + 60.0)
    assert model.goal_state("g.1") is GoalState.NOT_NEEDED
    model.learn("cup_2", "at", "hallway")
    until(model, first_s + 25 * HOUR_S)
    model.finish()
    assert model.goal_state("g.2") is GoalState.REACHED


def test_a_failed_run_is_said_and_the_schedule_goes_on() -> None:
    model = fleet()
    put(model, "Cup 1 must never be in the hallway", name="n")
    put(model, "Every two hours, bring cup 1 to the hallway")
    assert model.goal_state("g.1") is GoalState.FAILED
    status = model.goal_states["g"]
    assert "goal g.1 failed" in (status.reason or "")
    model.receive(events.GoalDeleted, goal="n")
    until(model, (status.next_s or 0.0) + 1.0)
    model.finish()
    assert model.goal_state("g.2") is GoalState.REACHED
    assert model.goal_states["g"].reason is None


def test_who_cancels_the_plan_of_a_run_ends_that_run() -> None:
    model = fleet()
    status = put(model, "Every two hours, bring cup 1 to the hallway")
    cancel = ControlRequest(request="c", plan="plan-1", control=Control.CANCEL)
    model.receive(events.ControlRequested, request=cancel)
    model.finish_cancelling()
    assert model.goal_state("g.1") is GoalState.FAILED
    assert "has cancelled" in (model.goal_states["g"].reason or "")
    until(model, status.next_s or 0.0)
    assert model.goal_states["g"].parts == ("g.2",)


def test_the_run_of_a_schedule_that_is_deleted_goes_on() -> None:
    model = fleet()
    first_s = daily(model)
    until(model, first_s)
    model.receive(events.GoalDeleted, goal="g")
    assert list(model.state.goals) == ["g.1"]
    model.crash()
    model.finish()
    assert model.goal_state("g.1") is GoalState.REACHED
    assert not model.state.goals
    until(model, first_s + 48 * HOUR_S)
    assert not model.state.plans


def test_a_part_is_deleted_with_the_whole_only() -> None:
    model = fleet()
    put(model, TEXT)
    before = model.state.goals
    model.receive(events.GoalDeleted, goal="g.1")
    assert model.state.goals == before


def test_a_run_can_be_taken_back_alone() -> None:
    model = fleet()
    status = put(model, "Every two hours, bring cup 1 to the hallway")
    model.receive(events.GoalDeleted, goal="g.1")
    model.finish_cancelling()
    assert list(model.state.goals) == ["g"]
    assert model.goal_states["g"].parts == ()
    until(model, status.next_s or 0.0)
    assert model.goal_states["g"].parts == ("g.2",)


def test_a_run_that_was_left_behind_ends_when_its_plan_is_cancelled() -> None:
    model = fleet()
    put(model, "Every two hours, bring cup 1 to the hallway")
    model.receive(events.GoalDeleted, goal="g")
    cancel = ControlRequest(request="c", plan="plan-1", control=Control.CANCEL)
    model.receive(events.ControlRequested, request=cancel)
    model.finish_cancelling()
    assert model.goal_state("g.1") is GoalState.FAILED
    assert not model.state.goals


def test_a_planner_without_its_journal_does_no_run_a_second_time() -> None:
    model = fleet()
    first_s = daily(model)
    until(model, first_s)
    model.finish()
    spec, status = model.state.goals["g"], model.goal_states["g"]
    other = fleet()
    other.time_s = first_s + HOUR_S
    other.receive(events.PriorStateLoaded, goals=(status,))
    other.receive(events.GoalPut, goal=spec)
    assert other.goal_states["g"].next_s == first_s + 24 * HOUR_S
    assert (other.goal_states["g"].parts, other.goal_states["g"].runs) == ((), 1)


@pytest.mark.parametrize(
    ("every", "says"), [("soon", "neither a line of cron"), ("0 7 * *", "neither a line of cron")]
)
def test_what_is_no_schedule_is_refused(every: str, says: str) -> None:
    status = put(fleet(), "Bring cup 1 to the hallway", every=every)
    assert status.state is GoalState.REJECTED
    assert says in (status.reason or "")


# --- what is kept --------------------------------------------------------------------------------


def test_what_is_kept_is_made_true_again() -> None:
    model = fleet()
    status = put(model, "Keep cup 1 in the kitchen")
    assert (status.state, status.parts) == (GoalState.STANDING, ())
    model.learn("cup_1", "at", "hallway")
    assert model.goal_states["g"].parts == ("g.1",)
    assert model.goal_states["g.1"].conditions == (at("cup_1", "kitchen"),)
    model.finish()
    assert model.goal_state("g.1") is GoalState.REACHED
    assert model.goal_states["g"].parts == ()
    model.learn("cup_1", "at", "living_room")
    model.finish()
    assert model.goal_state("g.2") is GoalState.REACHED
    model.receive(events.GoalDeleted, goal="g")
    model.learn("cup_1", "at", "hallway")
    assert not model.state.goals
    assert replay(map(decode_event, model.journal)) == model.state


def test_what_is_kept_constrains_other_plans() -> None:
    model = fleet()
    put(model, "Keep cup 1 in the kitchen")
    model.plan(bring(1, "hallway"))
    assert not model.replies["r0"].accepted
    assert "at(cup_1) = kitchen must always hold" in model.replies["r0"].sentence
    model.receive(events.GoalDeleted, goal="g1")
    model.plan(bring(2, "hallway"))
    model.finish()
    assert model.goal_state("g2") is GoalState.REACHED


def test_what_is_never_to_be_constrains_plans_that_run() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    assert model.orders()
    status = put(model, "locobot must never go to the hallway")
    assert status.state is GoalState.STANDING
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    assert at("locobot", "hallway") in model.plans["plan-1"].plan.never


def test_what_cannot_be_made_true_again_is_tried_later() -> None:
    model = fleet()
    put(model, "Keep cup 1 in the kitchen")
    put(model, "Cup 1 must never be in the living room", name="n")
    put(model, "hsr must never go to the hallway", name="m")
    model.learn("cup_1", "at", "hallway")
    assert model.goal_state("g.1") is GoalState.FAILED
    status = model.goal_states["g"]
    assert "goal g.1 failed" in (status.reason or "")
    assert status.next_s is not None
    model.learn("cup_2", "at", "hallway")
    assert model.goal_states["g"].parts == ()
    model.receive(events.GoalDeleted, goal="m")
    until(model, status.next_s)
    model.finish()
    assert model.goal_state("g.2") is GoalState.REACHED
    assert model.goal_states["g"].reason is None
    assert RETRY_S > 0.0


# --- several goals of one text -------------------------------------------------------------------

TEXT = "Bring cup 1 to the hallway. In an hour, bring cup 2 to the living room"


def test_a_text_can_be_several_goals_each_for_its_time() -> None:
    model = fleet()
    status = put(model, TEXT)
    assert (status.state, status.parts) == (GoalState.STANDING, ("g.1", "g.2"))
    assert [model.goal_state(part) for part in status.parts] == [
        GoalState.WAITING,
        GoalState.PENDING,
    ]
    model.receive(events.PlanRequested, request=PlanRequest(request="r", goals=("g",)))
    model.finish()
    assert model.goal_state("g.1") is GoalState.REACHED
    assert model.goal_states["g"].parts == ("g.2",)
    until(model, model.time_s + HOUR_S)
    model.finish()
    assert model.goal_state("g.2") is GoalState.REACHED
    assert model.goal_state("g") is GoalState.REACHED
    assert not model.state.goals
    assert all(plan.state is PlanState.SUCCEEDED for plan in model.plans.values())


def test_what_comes_after_something_repeated_waits_for_a_run_of_it() -> None:
    model = fleet()
    model.learn("cup_1", "at", None)
    put(model, "Every two hours, look for cup 1. If you find it, bring it to the hallway")
    assert model.goal_states["g.2"].reason == "it waits until g.1 has ended"
    model.learn("cup_1", "at", "living_room")
    model.finish()
    assert model.goal_state("g.1.1") is GoalState.REACHED
    assert model.goal_state("g.2") is GoalState.REACHED
    assert model.goal_state("g.1") is GoalState.STANDING


def test_several_goals_change_and_end_together() -> None:
    model = fleet()
    put(model, TEXT)
    put(model, "Bring cup 2 to the hallway")
    assert list(model.state.goals) == ["g"]
    assert model.goal_state("g") is GoalState.WAITING
    put(model, TEXT)
    model.crash()
    model.receive(events.GoalDeleted, goal="g")
    assert not model.state.goals
    assert not model.state.goal_states


def test_what_is_kept_stands_beside_what_is_done_once() -> None:
    model = fleet()
    status = put(model, "Bring cup 2 to the hallway in an hour. At noon, keep cup 1 in the kitchen")
    assert [model.goal_state(part) for part in status.parts] == [GoalState.PENDING] * 2
    until(model, model.time_s + 6 * HOUR_S)
    model.finish()
    assert model.goal_state("g.1") is GoalState.REACHED
    assert model.goal_state("g.2") is GoalState.STANDING
    assert model.goal_states["g"].parts == ("g.2",)


FIND = "Look for cup 1. If you find it, bring it to the hallway"


@pytest.mark.parametrize(
    ("found", "second", "whole"),
    [
        ("living_room", GoalState.REACHED, GoalState.REACHED),
        (None, GoalState.NOT_NEEDED, GoalState.FAILED),
    ],
)
def test_what_is_done_if_something_is_found_waits_for_the_search(
    found: str | None, second: GoalState, whole: GoalState
) -> None:
    model = fleet()
    model.learn("cup_1", "at", None)
    put(model, FIND)
    assert model.goal_states["g.2"].reason == "it waits until g.1 has ended"
    model.receive(events.PlanRequested, request=PlanRequest(request="r", goals=("g",)))
    assert {order.skill for order in model.orders()} <= {"navigate", "search"}
    if found is not None:
        model.learn("cup_1", "at", found)
    model.finish()
    assert model.goal_state("g.2") is second
    assert model.goal_state("g") is whole


def test_bringing_something_if_it_is_found_includes_looking_for_it() -> None:
    model = fleet()
    model.learn("cup_1", "at", None)
    found = Condition(relation="located", subject="cup_1", value=True)
    put(model, "Bring cup 1 to the hallway", only_if=(found,))
    assert model.goal_state("g") is GoalState.WAITING
    put(model, "Bring cup 2 to the hallway if you find cup 1", name="h")
    assert model.goal_state("h") is GoalState.PENDING


def test_what_is_kept_only_from_later_on_changes_no_plan_yet() -> None:
    model = fleet()
    model.learn("cup_2", "at", "living_room")
    put(model, "Cup 2 must never be in the living room", name="n")
    model.plan(bring(1, "hallway"))
    model.learn("cup_2", "at", "kitchen")
    before = model.plans["plan-1"]
    status = put(model, "In an hour, keep cup 2 in the kitchen", name="k")
    assert status.state is GoalState.PENDING
    assert model.plans["plan-1"] == before


EITHER = "If cup 2 is in the kitchen, bring it to the hallway. Otherwise bring it to the kitchen."


@pytest.mark.parametrize(("place", "goes_to"), [("kitchen", "hallway"), ("hallway", "kitchen")])
def test_one_of_both_is_done_and_the_other_is_not_needed(place: str, goes_to: str) -> None:
    model = fleet()
    model.learn("cup_2", "at", place)
    put(model, EITHER)
    first = place == "kitchen"
    states = [model.goal_state(name) for name in ("g.1", "g.2") if name in model.goal_states]
    assert (GoalState.NOT_NEEDED in states) and states[not first] is not GoalState.NOT_NEEDED
    model.receive(events.PlanRequested, request=PlanRequest(request="r", goals=("g",)))
    model.finish()
    assert model.goal_state("g") is GoalState.REACHED
    assert model.state.world().holds(at("cup_2", goes_to))


def test_what_is_done_otherwise_waits_to_be_told_as_the_other_does() -> None:
    model = fleet()
    model.learn("cup_2", "at", None)
    put(model, EITHER)
    assert [model.goal_state(name) for name in ("g.1", "g.2")] == [GoalState.PENDING] * 2
    model.learn("cup_2", "at", "kitchen")
    assert model.goal_state("g.2") is GoalState.NOT_NEEDED
    model.finish()
    assert model.state.world().holds(at("cup_2", "hallway"))


def test_what_is_done_where_nothing_is_found_waits_for_the_search() -> None:
    model = fleet()
    model.learn("cup_1", "at", None)
    put(model, "If you find cup 1, bring it to the hallway; if not, bring cup 2 to the hallway")
    assert model.goal_states["g.2"].reason == "it waits until g.1 has ended"
    model.receive(events.PlanRequested, request=PlanRequest(request="r", goals=("g",)))
    model.finish()
    assert model.goal_state("g.2") is GoalState.REACHED
    assert model.goal_state("g") is GoalState.REACHED


@pytest.mark.parametrize("known", [True, False])
def test_what_is_not_found_is_no_failure_where_it_is_said_what_is_done_then(known: bool) -> None:
    model = fleet()
    if not known:
        model.learn("cup_1", "at", None)
    put(
        model,
        "Look for cup 1. If you find it, bring it to the hallway; "
        "otherwise bring cup 2 to the hallway",
    )
    model.receive(events.PlanRequested, request=PlanRequest(request="r", goals=("g",)))
    model.finish()
    assert model.goal_state("g") is GoalState.REACHED, model.goal_states["g"].reason
    assert model.state.world().holds(at("cup_1" if known else "cup_2", "hallway"))
    assert not model.state.world().holds(at("cup_2" if known else "cup_1", "hallway"))
