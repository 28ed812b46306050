"""Emergency stops in the planner: no orders meanwhile, and nobody has failed."""

from __future__ import annotations

from fleet.core import events
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.stops import Stop, StopRelease
from keyexpr_schema.payloads.tasks import Order, ReportState, TaskState
from tests.support.fleet_model import FleetModel
from tests.support.household import bring, manipulator

ALL = Stop(stop="s1", by="ana@lab", reason="somebody is in the way")


def planned(*robots: str) -> tuple[FleetModel, Order]:
    """A plan for one cup; its first order stands."""
    model = FleetModel(tuple(map(manipulator, robots)), cups=1)
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    return model, order


def test_nothing_is_ordered_while_a_stop_stands() -> None:
    model, order = planned("r1")
    model.receive(events.StopPut, stop=ALL)
    model.succeed(order)
    assert model.wanted() == []
    model.receive(events.StopDeleted, stop="s1")
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_second_stop_holds_when_the_first_is_over() -> None:
    model, order = planned("r1")
    model.receive(events.StopPut, stop=ALL)
    model.receive(events.StopPut, stop=Stop(stop="s2", robots=("r1",)))
    model.succeed(order)
    model.receive(events.StopDeleted, stop="s1")
    assert model.wanted() == []
    model.receive(events.StopDeleted, stop="s2")
    assert model.wanted() != []


def test_a_released_robot_works_while_the_stop_holds_others() -> None:
    model, order = planned("r1")
    model.receive(events.StopPut, stop=ALL)
    model.succeed(order)
    model.receive(events.StopReleased, release=StopRelease(stop="s1", robot="r1"))
    assert [o.robot for o in model.wanted()] == ["r1"]
    model.receive(events.StopReleaseDeleted, stop="s1", robot="r1")
    model.succeed(model.wanted()[0])
    assert model.wanted() == []


def test_however_often_it_is_stopped_the_task_goes_on_and_nothing_has_failed() -> None:
    model, _ = planned("r1")
    for number in range(10):
        name = f"s{number}"
        (order,) = model.wanted()
        model.start(order)
        model.receive(events.StopPut, stop=Stop(stop=name))
        model.report(order, ReportState.INTERRUPTED, reason="stopped", stops=(name,))
        assert model.wanted() == []
        model.receive(events.StopDeleted, stop=name)
    entry = model.plans["plan-1"]
    assert entry.failures == {}
    assert {record.state for record in entry.records.values()} & {TaskState.FAILED} == set()
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_robot_that_rests_is_not_late() -> None:
    model, order = planned("r1", "r2")
    model.start(order)
    model.receive(events.StopPut, stop=ALL)
    model.time_s += 10_000.0
    model.receive(events.TimerFired)
    assert model.plans["plan-1"].late == ()
    model.receive(events.StopDeleted, stop="s1")
    model.receive(events.TimerFired)
    assert model.plans["plan-1"].late == (order.task,)
