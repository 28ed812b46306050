"""Robots that are away, lost, and back: what becomes of the orders that they had."""

from __future__ import annotations

from fleet.core import events
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import Control, ControlRequest
from keyexpr_schema.payloads.tasks import Order, ReportState, TaskState
from tests.support.fleet_model import BOTH, FleetModel, fleet
from tests.support.household import bring, manipulator


def two_arms(cups: int = 1) -> FleetModel:
    return FleetModel((manipulator("r1"), manipulator("r2")), cups=cups)


def picking() -> tuple[FleetModel, Order]:
    """One of two robots has been told to pick up the cup, and has begun."""
    model = two_arms()
    model.plan(bring(1, "hallway"))
    model.succeed(model.orders()[0])
    (order,) = model.orders()
    assert order.skill == "pick"
    model.start(order)
    return model, order


def other(robot: str) -> str:
    return {"r1": "r2", "r2": "r1"}[robot]


def control(model: FleetModel, what: Control, plan: str = "plan-1") -> tuple[bool, str]:
    name = f"c{len(model.journal)}"
    request = ControlRequest(request=name, control=what, plan=plan)
    model.receive(events.ControlRequested, request=request)
    answer = model.documents[f"answers/{name}"]
    return answer.accepted, answer.sentence


def test_the_order_of_a_lost_robot_is_cancelled_and_what_it_handles_stays_reserved() -> None:
    model, order = picking()
    model.lose(order.robot)
    (kept,) = [o for o in model.orders() if o.robot == order.robot]
    assert (kept.task, kept.attempt, kept.cancelled) == (order.task, order.attempt, True)
    model.finish()
    # The other one has gone there, and leaves the cup alone until the first has spoken.
    assert model.wanted() == []
    assert model.goal_state("g1") is GoalState.RUNNING
    model.return_(order.robot)
    model.cancelled(kept)
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    assert model.orders() == []


def test_what_a_lost_robot_did_is_no_failure_of_the_goal() -> None:
    model, order = picking()
    model.lose(order.robot)
    entry = model.plans["plan-1"]
    assert entry.failures == {}
    assert entry.records[order.task].state is TaskState.RUNNING
    assert "has been away" in (entry.records[order.task].reason or "")


def test_success_that_is_reported_late_counts() -> None:
    model, order = picking()
    model.lose(order.robot)
    model.return_(order.robot)
    model.succeed(order)
    assert model.plans["plan-1"].records[order.task].state is TaskState.SUCCEEDED
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    records = model.plans["plan-1"].records.values()
    assert [r.robot for r in records if r.skill == "pick" and r.attempt] == [order.robot]


def test_an_unregistered_robot_that_is_away_will_never_speak() -> None:
    model, order = picking()
    model.lose(order.robot)
    model.finish()
    model.receive(events.RobotUnregistered, robot=order.robot)
    assert all(o.robot == other(order.robot) for o in model.orders())
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_an_unregistered_robot_that_is_there_is_waited_for() -> None:
    model, order = picking()
    model.receive(events.RobotUnregistered, robot=order.robot)
    assert [o.cancelled for o in model.orders() if o.robot == order.robot] == [True]
    model.receive(events.WorkerDisconnected, robot=order.robot, incarnation="i1")
    assert [o for o in model.orders() if o.robot == order.robot] == []


def test_a_plan_can_be_cancelled_though_a_robot_of_it_is_lost() -> None:
    model, order = picking()
    model.receive(events.WorkerDisconnected, robot=order.robot, incarnation="i1")
    assert control(model, Control.CANCEL)[0]
    assert model.plans["plan-1"].state is PlanState.RUNNING
    model.wall_s += model.state.policy.lost_after_s + 1.0
    model.receive(events.TimerFired)
    assert model.plans["plan-1"].state is PlanState.CANCELLED
    assert [o.cancelled for o in model.orders()] == [True]
    # Another plan about the same cup waits for what the lost robot has to say of it.
    model.plan()
    model.finish()
    assert [o.robot for o in model.orders()] == [order.robot]
    model.return_(order.robot)
    model.cancelled(model.orders()[0])
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_plan_that_is_being_cancelled_counts_on_a_robot_that_is_no_more() -> None:
    """Its first robot has not spoken yet, and what the other was to do had not begun: each look at
    it led to another one, without end."""
    model = two_arms(cups=2)
    model.receive(events.HoldPut, hold=Hold(hold="p", kind=HoldKind.PAUSE, robots=("r2",)))
    model.plan(*BOTH)
    (first,) = model.wanted()
    model.start(first)
    model.late = True
    assert control(model, Control.CANCEL)[0]
    model.receive(events.RobotUnregistered, robot="r2")
    model.cancelled(first)
    assert model.plans["plan-1"].state is PlanState.CANCELLED


def test_a_plan_with_an_order_that_may_be_carried_out_is_not_deleted() -> None:
    model, order = picking()
    control(model, Control.CANCEL)
    model.lose(order.robot)
    accepted, sentence = control(model, Control.DELETE)
    assert not accepted
    assert f"{order.robot} with {order.task}" in sentence
    assert len(model.orders()) == 1
    model.return_(order.robot)
    model.cancelled(model.orders()[0])
    assert model.orders() == []


def test_no_attempt_has_the_serial_of_another() -> None:
    model = fleet()
    model.plan(*BOTH)
    seen: dict[int, tuple[str, str, int]] = {}
    while orders := model.orders():
        for order in orders:
            attempt = (order.plan, order.task, order.attempt)
            assert order.serial > 0
            assert seen.setdefault(order.serial, attempt) == attempt
            assert order.planner == "one"
        if len(seen) == 3:
            model.interrupt(orders[0], done=False)
            model.crash()
        else:
            model.succeed(orders[0])
    assert sorted(seen) == list(range(1, len(seen) + 1))


def test_reports_of_another_planners_attempts_bring_facts_only() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    before = model.plans
    for planner in ("another", "two"):
        model.report(order, ReportState.SUCCEEDED, facts=model.facts_after(order), planner=planner)
    assert model.plans == before
    model.report(order, ReportState.STARTED, started_s=1.0, planner=None)
    assert model.plans["plan-1"].records[order.task].state is TaskState.RUNNING


def test_a_cancelled_plan_waits_for_those_that_are_there_whoever_of_it_is_lost() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    (order,) = (order for order in model.orders() if order.robot == "hsr")
    drive = ControlRequest(
        request="drive",
        control=Control.ADD_TASK,
        plan="plan-1",
        skill="navigate",
        args={"to": "kitchen"},
        after=(order.task,),
        robot="locobot",
    )
    model.receive(events.ControlRequested, request=drive)
    assert control(model, Control.CANCEL)[0]
    model.lose("locobot")
    assert model.plans["plan-1"].state is PlanState.RUNNING
    model.cancelled(order)
    assert model.plans["plan-1"].state is PlanState.CANCELLED


def test_a_cancelled_plan_does_not_wait_for_a_lost_robots_word_on_what_it_had_dropped() -> None:
    model = FleetModel((manipulator(), manipulator("r2")), cups=2)
    model.plan(*BOTH)
    dropped, other = model.orders()
    goal = model.state.plans["plan-1"].records[dropped.task].goal
    model.receive(events.GoalDeleted, goal=goal)
    assert dropped.task not in {task.task for task in model.state.plans["plan-1"].plan.tasks}
    assert control(model, Control.CANCEL)[0]
    model.cancelled(next(order for order in model.orders() if order.robot == other.robot))
    assert not model.plans["plan-1"].ended
    model.lose(dropped.robot)
    assert model.plans["plan-1"].state is PlanState.CANCELLED
