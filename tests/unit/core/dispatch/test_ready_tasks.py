"""What is ready is ordered, but for drives to where the plan has brought a robot already."""

from __future__ import annotations

from fleet.core import events
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.tasks import Order, TaskState
from keyexpr_schema.payloads.world import Fact
from tests.support.fleet_model import FleetModel
from tests.support.household import bring, manipulator


def there_and_back() -> FleetModel:
    """One cup is to go where the other is, and that one from there to the first place."""
    made = FleetModel((manipulator(),), cups=2)
    made.learn("cup_2", "at", "hallway")
    made.plan(bring(1, "hallway"), bring(2, "kitchen"))
    return made


def carried_out(made: FleetModel) -> list[tuple[str, str]]:
    """The orders from now on: skills, and where."""
    seen: list[tuple[str, str]] = []
    while orders := made.orders():
        made.succeed(orders[0])
        seen.append(_said(orders[0]))
    return seen


def _said(order: Order) -> tuple[str, str]:
    return order.skill, order.args.get("to") or order.args["place"]


def first_half(made: FleetModel) -> None:
    """Up to the first cup that is put down."""
    while (order := made.orders()[0]).skill != "place":
        made.succeed(order)


def test_a_robot_is_not_sent_to_where_the_plan_has_brought_it() -> None:
    made = there_and_back()
    seen = carried_out(made)
    drives = [to for skill, to in seen if skill == "navigate"]
    assert drives in (["kitchen", "hallway", "kitchen"], ["hallway", "kitchen", "hallway"])
    records = made.plans["plan-1"].records
    (skipped,) = (record for record in records.values() if record.attempt == 0)
    assert (skipped.state, skipped.skill) == (TaskState.SUCCEEDED, "navigate")
    assert skipped.reason == "hsr stands there already"
    assert skipped.started_s == skipped.ended_s is not None
    assert made.goal_state("g1") is made.goal_state("g2") is GoalState.REACHED


def test_where_it_stood_before_the_plan_its_worker_sees_better() -> None:
    made = FleetModel((manipulator(),), cups=1)
    fact = Fact(subject="hsr", relation="at", value="kitchen", source="hsr", time_s=made.time_s)
    made.receive(events.FactPut, fact=fact)
    made.plan(bring(1, "hallway"))
    assert carried_out(made)[0] == ("navigate", "kitchen")


def test_a_robot_that_is_only_believed_to_be_there_is_sent_there() -> None:
    made = there_and_back()
    first_half(made)
    place = made.orders()[0]
    where = place.args["place"]
    # Somebody else says so, after the robot did.
    made.learn("hsr", "at", where)
    assert carried_out(made)[:2] == [_said(place), ("navigate", where)]


def test_a_robot_that_was_taken_elsewhere_is_sent_there() -> None:
    made = there_and_back()
    first_half(made)
    order = made.orders()[0]
    where = order.args["place"]
    # A report comes first, and then what was said of the robot while it was on its way.
    made.start(order)
    made.learn("hsr", "at", "living_room")
    seen = carried_out(made)
    assert ("navigate", where) in seen
    assert made.goal_state("g1") is made.goal_state("g2") is GoalState.REACHED


def test_the_same_comes_out_after_a_crash() -> None:
    made = there_and_back()
    first_half(made)
    made.crash()
    seen = carried_out(made)
    assert [skill for skill, _ in seen] == ["place", "pick", "navigate", "place"]
