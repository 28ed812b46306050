"""A new revision and what is under way: what goes on, what is cancelled first."""

from __future__ import annotations

from fleet.core import events
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanChange, PlanState
from keyexpr_schema.payloads.requests import ReplanRequest
from keyexpr_schema.payloads.tasks import ReportState
from tests.support.fleet_model import BOTH, FleetModel, fleet
from tests.support.household import bring, carrier, manipulator


def test_a_replan_that_changes_nothing_disturbs_nobody() -> None:
    model = fleet()
    model.plan(*BOTH)
    before = model.orders()
    model.start(before[0])
    model.receive(
        events.ReplanRequested, request=ReplanRequest(request="x", plan="plan-1", reason="I say so")
    )
    entry = model.plans["plan-1"]
    assert entry.plan.revision == 2
    assert entry.change == PlanChange(kept=9, dropped=0, added=0)
    assert model.orders() == before
    model.finish()
    assert model.plans["plan-1"].state is PlanState.SUCCEEDED


def test_a_replan_in_the_middle_of_a_pick_goes_on_with_it() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.succeed(model.orders()[0])
    (pick,) = model.orders()
    model.start(pick)
    model.receive(
        events.ReplanRequested, request=ReplanRequest(request="x", plan="plan-1", reason="I say so")
    )
    assert model.orders() == [pick]
    assert model.plans["plan-1"].change == PlanChange(kept=3, dropped=0, added=0)
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_work_that_is_no_longer_wanted_is_cancelled_before_what_conflicts_starts() -> None:
    model = FleetModel((manipulator("r1"), manipulator("r2")), cups=1)
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    model.start(order)
    other = {"r1": "r2", "r2": "r1"}[order.robot]
    # The cup turns out to be in the other robot's hand: that one has to bring it.
    model.learn(other, "holding", "cup_1")
    model.learn("cup_1", "at", other)
    dropped = [o for o in model.orders() if o.cancelled]
    assert [o.task for o in dropped] == [order.task]
    assert model.plans["plan-1"].change is not None
    model.report(dropped[0], ReportState.CANCELLED)
    assert {o.robot for o in model.orders()} == {other}
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_waiting_task_that_is_so_already_counts_once() -> None:
    """It was counted as kept and as needless, and taken off the tasks added twice.

    The model checks every revision's counts against the records.
    """
    model = FleetModel((manipulator(), carrier()), 3)
    model.plan(bring(1, "living_room"), bring(2, "hallway"), bring(3, "hallway"))

    def order(number: int):  # type: ignore[no-untyped-def]
        return model.orders()[number % len(model.orders())]

    model.start(order(3))
    model.start(order(2))
    model.fail(order(3))
    model.interrupt(order(0), done=True)
    model.interrupt(order(0), done=False)
    model.fail(order(7))
    (entry,) = model.plans.values()
    assert entry.plan.revision == 3
    model.finish()
