"""Names of plans: a number never comes back, whatever is deleted."""

from __future__ import annotations

from fleet.core import events
from keyexpr_schema.payloads.requests import Control, ControlRequest
from tests.support.fleet_model import FleetModel, fleet
from tests.support.household import bring


def plan_of(model: FleetModel) -> str:
    (plan,) = model.plans
    return plan


def delete(model: FleetModel, plan: str) -> None:
    request = ControlRequest(request=f"c{len(model.journal)}", control=Control.DELETE, plan=plan)
    model.receive(events.ControlRequested, request=request)
    assert plan not in model.plans


def test_the_name_of_a_deleted_plan_is_not_given_again() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"), start=False)
    delete(model, "plan-1")
    model.plan(start=False)
    assert plan_of(model) == "plan-2"
    delete(model, "plan-2")
    model.crash()
    model.plan()
    assert plan_of(model) == "plan-3"
    model.finish()


def test_a_number_that_a_person_chose_counts_as_well() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"), plan="plan-7", start=False)
    delete(model, "plan-7")
    model.plan(start=False)
    assert plan_of(model) == "plan-8"
