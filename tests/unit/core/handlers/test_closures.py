"""Closures: what robots no longer get to, who does it then, and what waits until it is open."""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from fleet.core import events
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.tasks import Order
from keyexpr_schema.payloads.world import Way
from tests.support.fleet_model import BOTH, FleetModel
from tests.support.household import PLACES, bring, manipulator


def close(model: FleetModel, *names: str, **more: Any) -> None:
    closure = Closure(closure="c1", names=names, by="ana", reason="wet floor", **more)
    model.receive(events.ClosurePut, closure=closure)


def reopen(model: FleetModel) -> None:
    model.receive(events.ClosureDeleted, closure="c1")


def other_model(name: str) -> RobotSpec:
    return replace(manipulator(name), model="butler")


def one_order(model: FleetModel) -> Order:
    (order,) = model.wanted()
    return order


def test_a_goal_behind_a_closed_place_waits_with_the_reason_until_it_is_open() -> None:
    model = FleetModel((manipulator("r1"),), cups=1)
    model.learn("r1", "at", "hallway")
    close(model, "living_room")
    model.plan(bring(1, "living_room"))
    assert model.orders() == []
    status = model.state.goal_states["g1"]
    assert status.state is GoalState.WAITING
    assert status.reason is not None
    assert "living_room is closed by ana (wet floor)" in status.reason
    reopen(model)
    model.plan()
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_plan_through_a_place_that_closes_waits_and_nothing_has_failed() -> None:
    model = FleetModel((manipulator("r1"),), cups=1)
    model.learn("r1", "at", "kitchen")
    model.plan(bring(1, "living_room"))
    for _ in range(2):
        model.succeed(one_order(model))
    close(model, "living_room")
    waiting = model.state.goal_states["g1"]
    assert waiting.state is GoalState.WAITING and "closed" in str(waiting.reason)
    model.fail(one_order(model), reason="no way to living_room", retryable=False)
    assert model.orders() == []
    (entry,) = model.plans.values()
    assert (entry.failures, entry.hopeless) == ({}, ())
    reopen(model)
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_work_goes_to_a_robot_of_a_kind_that_may_enter() -> None:
    model = FleetModel((manipulator("r1"), other_model("r2")), cups=1)
    model.plan(bring(1, "hallway"))
    first = one_order(model)
    close(model, "kitchen", models=(model.state.robots[first.robot].model,))
    for order in model.orders():
        if order.cancelled:
            model.cancelled(order)
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    other = {"r1": "r2", "r2": "r1"}[first.robot]
    picks = [r for e in model.plans.values() for r in e.records.values() if r.skill == "pick"]
    assert {r.robot for r in picks if r.attempt} == {other}


def test_its_time_is_over_without_a_word() -> None:
    model = FleetModel((manipulator("r1"),), cups=1)
    close(model, "kitchen", until_s=model.time_s + 50.0)
    assert model.state.closures
    model.time_s += 50.0
    model.receive(events.TimerFired)
    assert not model.state.closures
    close(model, "kitchen", until_s=model.time_s - 5.0)
    assert not model.state.closures


def test_who_is_inside_may_leave_and_one_at_a_time_closes_nothing() -> None:
    model = FleetModel((manipulator("r1"),), cups=1)
    model.learn("r1", "at", "kitchen")
    close(model, "kitchen")
    world = model.state.world()
    assert world.kept_from("r1", "hallway") is None
    assert world.kept_from("r1", "kitchen") is None
    reopen(model)
    close(model, "kitchen", one_at_a_time=True)
    model.learn("r1", "at", "hallway")
    assert model.state.world().kept_from("r1", "kitchen") is None


def test_ways_go_around_a_closed_door_and_take_as_long() -> None:
    ways = {
        "kitchen": (
            Way(to="living_room", length_m=3.0, through=("serving_door",)),
            Way(to="hallway", length_m=4.0, through=("kitchen_door",)),
        ),
        "hallway": (
            Way(to="kitchen", length_m=4.0, through=("kitchen_door",)),
            Way(to="living_room", length_m=4.0, through=("living_room_door",)),
        ),
        "living_room": (
            Way(to="hallway", length_m=4.0, through=("living_room_door",)),
            Way(to="kitchen", length_m=3.0, through=("serving_door",)),
        ),
    }
    model = FleetModel((manipulator("r1"),), cups=1)
    for place in PLACES:
        model.receive(events.PlacePut, place=replace(place, ways=ways[place.place]))
    model.learn("r1", "at", "kitchen")
    assert model.state.world().way_s("r1", "kitchen", "hallway") == 4.0 / 0.6
    close(model, "kitchen_door")
    world = model.state.world()
    assert world.way_s("r1", "kitchen", "hallway") == 7.0 / 0.6
    assert world.kept_from("r1", "hallway") is None
    close(model, "kitchen_door", "serving_door")
    why = model.state.world().kept_from("r1", "hallway")
    assert why == (
        "r1 does not get to hallway: kitchen_door and serving_door are closed by ana (wet floor)"
    )


def test_both_goals_are_reached_when_a_closure_ends_in_the_middle() -> None:
    model = FleetModel((manipulator("r1"), manipulator("r2")), cups=2)
    model.plan(*BOTH)
    model.succeed(model.wanted()[0])
    close(model, "hallway")
    for order in model.orders():
        if order.cancelled:
            model.cancelled(order)
    reopen(model)
    model.finish()
    assert [model.goal_state(g) for g in ("g1", "g2")] == [GoalState.REACHED] * 2
    assert all(entry.failures == {} for entry in model.plans.values())
