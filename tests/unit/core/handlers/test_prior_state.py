"""A planner without its journal, beside the keys that an earlier one has left."""

from __future__ import annotations

from fleet.core import events
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.tasks import Order, ReportState
from tests.support.fleet_model import FleetModel
from tests.support.household import bring, manipulator


def left_behind(robot: str, plan: str = "plan-4") -> Order:
    return Order(
        robot=robot, plan=plan, revision=2, task="t2", attempt=1, epoch=7, skill="pick",
        args={"robot": robot, "object": "cup_1", "place": "kitchen"}, deadline_s=100.0,
        planner="lost", serial=9,
    )  # fmt: skip


def beside(*orders: Order, plans: tuple[str, ...] = ()) -> FleetModel:
    model = FleetModel((manipulator("r1"), manipulator("r2")), cups=1)
    model.receive(events.PriorStateLoaded, orders=orders, plans=plans)
    return model


def test_what_an_earlier_planner_ordered_is_cancelled_and_reserved() -> None:
    model = beside(left_behind("r1"))
    (order,) = model.orders()
    assert order.cancelled
    assert (order.planner, order.plan, order.task, order.attempt) == ("lost", "plan-4", "t2", 1)
    model.plan(bring(1, "hallway"))
    assert {o.robot for o in model.wanted()} <= {"r2"}
    for wanted in model.wanted():
        model.succeed(wanted)
    assert model.wanted() == [], "the cup is taken while r1 may hold it"
    model.cancelled(order)
    assert "plan-4" not in model.state.plans
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_reports_of_the_new_planners_attempts_of_the_same_name_do_not_count() -> None:
    model = beside(left_behind("r1"))
    (order,) = model.orders()
    model.report(order, ReportState.SUCCEEDED, planner="one")
    assert model.state.plans["plan-4"].state is PlanState.CANCELLED
    assert len(model.orders()) == 1
    model.report(order, ReportState.SUCCEEDED)
    assert "plan-4" not in {order.plan for order in model.orders()}, "what r1 holds is put down"


def test_numbers_go_on_after_the_highest_that_was_seen() -> None:
    model = beside(left_behind("r1"), plans=("plan-2", "mine"))
    model.plan(bring(1, "hallway"), start=False)
    assert "plan-5" in model.state.plans
    model = beside(plans=("plan-12",))
    model.plan(bring(1, "hallway"), start=False)
    assert "plan-13" in model.state.plans
