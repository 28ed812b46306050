"""Pauses and drains: who gets no order meanwhile, and what becomes of the work."""

from __future__ import annotations

from typing import Any

from fleet.core import events
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.tasks import Order
from tests.support.fleet_model import BOTH, FleetModel
from tests.support.household import bring, carrier, manipulator


def two_arms(cups: int = 1) -> FleetModel:
    return FleetModel((manipulator("r1"), manipulator("r2")), cups=cups)


def put(model: FleetModel, kind: HoldKind = HoldKind.PAUSE, **what: Any) -> None:
    model.receive(events.HoldPut, hold=Hold(hold="h1", kind=kind, by="ana", **what))


def end(model: FleetModel) -> None:
    model.receive(events.HoldDeleted, hold="h1")


def one_order(model: FleetModel) -> Order:
    (order,) = model.wanted()
    return order


def other(robot: str) -> str:
    return {"r1": "r2", "r2": "r1"}[robot]


def test_a_paused_fleet_ends_what_runs_and_begins_nothing() -> None:
    model = two_arms()
    model.plan(bring(1, "hallway"))
    order = one_order(model)
    put(model)
    assert model.wanted() == [order]
    model.succeed(order)
    assert model.orders() == []
    end(model)
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_paused_robot_keeps_its_work_and_others_go_on() -> None:
    model = two_arms(cups=2)
    model.plan(*BOTH)
    paused = model.wanted()[0].robot
    put(model, robots=(paused,))
    model.finish()
    entry = model.plans["plan-1"]
    assert set(entry.index.waiting_of) == {paused}
    end(model)
    model.finish()
    assert [model.goal_state(g) for g in ("g1", "g2")] == [GoalState.REACHED] * 2


def test_a_paused_plan_leaves_its_robots_to_others() -> None:
    model = FleetModel((manipulator("r1"),), cups=2)
    model.plan(bring(1, "hallway"))
    put(model, plans=("plan-1",))
    model.succeed(one_order(model))
    assert model.orders() == []
    end(model)
    assert one_order(model).plan == "plan-1"


def test_what_is_interrupted_is_done_again_and_nothing_has_failed() -> None:
    model = two_arms()
    model.plan(bring(1, "hallway"))
    order = one_order(model)
    model.start(order)
    put(model, plans=("plan-1",), interrupt=True)
    (cancelled,) = model.orders()
    assert cancelled.cancelled
    model.cancelled(order)
    assert model.orders() == []
    end(model)
    again = one_order(model)
    assert (again.task, again.attempt) == (order.task, order.attempt + 1)
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    assert model.plans["plan-1"].failures == {}


def test_what_ended_before_it_could_be_interrupted_has_ended() -> None:
    model = two_arms()
    model.plan(bring(1, "hallway"))
    order = one_order(model)
    put(model, robots=(order.robot,), interrupt=True)
    model.succeed(order)
    assert model.orders() == [] and model.plans["plan-1"].halting == ()
    end(model)
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_drained_robot_ends_its_task_and_the_rest_goes_to_the_other() -> None:
    model = two_arms()
    model.plan(bring(1, "hallway"))
    order = one_order(model)
    model.start(order)
    put(model, HoldKind.DRAIN, robots=(order.robot,))
    assert not model.orders()[0].cancelled
    model.succeed(order)
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    records = model.plans["plan-1"].records.values()
    assert {r.robot for r in records if r.skill == "pick" and r.attempt} == {other(order.robot)}


def test_a_drained_robot_delivers_what_it_carries() -> None:
    model = two_arms()
    model.plan(bring(1, "hallway"))
    model.succeed(one_order(model))
    pick = one_order(model)
    assert pick.skill == "pick"
    model.succeed(pick)
    put(model, HoldKind.DRAIN, robots=(pick.robot,))
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    assert {order[1] for order in model.given.items()} == {pick.robot}
    assert pick.robot not in model.state.team()


def test_what_only_a_drained_robot_can_do_waits_for_its_return() -> None:
    model = FleetModel((manipulator("r1"),), cups=1)
    put(model, HoldKind.DRAIN, robots=("r1",))
    model.plan(bring(1, "hallway"))
    model.finish()
    assert model.goal_state("g1") is GoalState.WAITING
    assert model.goal_states["g1"].reason == "no robot is connected; r1 is drained by ana"
    end(model)
    model.plan()
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_what_those_who_are_there_cannot_do_names_who_is_drained() -> None:
    model = FleetModel((manipulator("r1"), carrier("r2")), cups=1)
    put(model, HoldKind.DRAIN, robots=("r1",), reason="a new battery")
    model.plan(bring(1, "hallway"))
    reason = model.goal_states["g1"].reason or ""
    assert reason.endswith("; r1 is drained by ana (a new battery)")


def test_who_has_not_said_yet_what_its_hand_holds_is_named_where_the_others_cannot_do_it() -> None:
    model = FleetModel((manipulator(), carrier()), cups=1)
    model.receive(events.FactDeleted, relation="holding", subject="hsr")
    model.plan(bring(1, "hallway"))
    assert "; what hsr has in its hand is not known yet" in str(model.goal_states["g1"].reason)
