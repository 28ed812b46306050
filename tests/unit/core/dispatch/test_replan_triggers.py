"""What leads to a new revision: facts, finds, robots that come, go or return."""

from __future__ import annotations

from fleet.core import events
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.tasks import ReportState
from tests.support.fleet_model import BOTH, FleetModel, fleet
from tests.support.household import bring, manipulator


def test_a_lost_robots_work_goes_to_another() -> None:
    model = FleetModel((manipulator("r1"), manipulator("r2")), cups=1)
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    other = {"r1": "r2", "r2": "r1"}[order.robot]
    model.lose(order.robot)
    assert {o.robot for o in model.wanted()} == {other}
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_worker_that_comes_back_in_time_keeps_its_work() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    model.receive(events.WorkerDisconnected, robot="hsr", incarnation="i1")
    model.receive(events.TimerFired)
    model.receive(events.WorkerConnected, robot="hsr", incarnation="i2")
    assert model.orders() == [order]
    assert model.plans["plan-1"].plan.revision == 1


def test_a_fact_that_contradicts_the_plan_leads_to_a_new_one() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.learn("cup_1", "at", "living_room")
    model.succeed(model.orders()[0])
    entry = model.plans["plan-1"]
    assert entry.plan.revision == 2
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_what_a_running_task_is_just_making_true_is_no_news() -> None:
    model = fleet()
    model.late = True
    model.plan(bring(1, "hallway"))
    model.answer()
    while (order := model.orders()[0]).skill != "place":
        model.succeed(order)
    model.start(order)
    for fact in model.facts_after(order):
        model.learn(fact.subject, fact.relation, fact.value)  # seen by another, before the report
    assert not model.answers, "that is what the plan is about"
    model.succeed(order)
    assert model.goal_state("g1") is GoalState.REACHED
    assert model.plans["plan-1"].state is PlanState.SUCCEEDED


def test_what_somebody_else_says_against_a_running_task_is_news() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    while (order := model.orders()[0]).skill != "place":
        model.succeed(order)
    model.start(order)
    model.late = True
    model.learn("hsr", "at", "living_room")
    assert model.answers


def test_what_nobody_can_look_for_is_told() -> None:
    model = FleetModel((manipulator(),), cups=1)
    blind = manipulator().__class__(
        robot="hsr", model="hsr", skills=("navigate",), capabilities={"drive": 1.0}
    )
    model.receive(events.RobotRegistered, spec=blind)
    model.receive(events.FactDeleted, subject="cup_1", relation="at")
    model.plan(bring(1, "hallway"))
    assert not model.replies["r0"].accepted
    assert "where cup_1 is" in model.replies["r0"].sentence
    assert model.goal_state("g1") is GoalState.WAITING
    assert model.plans["plan-1"].state is PlanState.REJECTED


def test_a_discovery_ends_the_search_and_leads_to_the_goal() -> None:
    model = fleet()
    model.learn("cup_1", "at", None)
    model.plan(bring(1, "hallway"))
    searching = {order.robot for order in model.orders()}
    assert searching == {"hsr", "locobot"}
    while not any(o.robot == "locobot" and o.skill == "search" for o in model.orders()):
        model.succeed(next(o for o in model.orders() if o.robot == "locobot"))
    model.learn("cup_1", "at", "living_room")
    entry = model.plans["plan-1"]
    assert entry.plan.revision == 2
    assert "pick" in {task.skill for task in entry.plan.tasks}
    for order in model.orders():
        if order.cancelled:
            model.report(order, ReportState.CANCELLED)
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_what_is_found_nowhere_ends_the_goal_with_where_it_was_looked_for() -> None:
    model = fleet()
    model.learn("cup_1", "at", None)
    model.plan(bring(1, "hallway"))
    model.finish()
    assert model.goal_state("g1") is GoalState.FAILED
    reason = model.goal_states["g1"].reason or ""
    assert "looked for in hallway, kitchen, living_room" in reason


def test_a_robot_that_is_unregistered_loses_its_work_and_gets_new_once_it_is_back() -> None:
    model = FleetModel((manipulator("r1"), manipulator("r2")), cups=2)
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    other = {"r1": "r2", "r2": "r1"}[order.robot]
    model.receive(events.RobotUnregistered, robot=order.robot)
    assert {o.robot for o in model.wanted()} == {other}
    model.finish()
    model.receive(events.RobotRegistered, spec=manipulator(order.robot))
    assert model.state.ready(order.robot)
    model.plan(bring(2, "hallway"))
    model.finish()
    assert model.goal_state("g2") is GoalState.REACHED


def test_a_new_robot_is_given_a_share() -> None:
    model = FleetModel((manipulator("r1"),), cups=2)
    model.plan(*BOTH)
    model.receive(events.RobotRegistered, spec=manipulator("r2"))
    model.receive(events.WorkerConnected, robot="r2", incarnation="i1")
    model.learn("r2", "holding", "nothing")
    entry = model.plans["plan-1"]
    assert entry.plan.revision == 2
    assert {record.robot for record in entry.current()} == {"r1", "r2"}
    model.finish()
    assert entry.plan.goals == ("g1", "g2")
    assert model.plans["plan-1"].state is PlanState.SUCCEEDED
