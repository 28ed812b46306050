"""Workers' reports in the core: failures, interruptions, late ones."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fleet.core import events
from fleet.core.handlers.reports import MAX_FAILURES
from fleet.core.revision.replanning import MAX_REPLANS
from keyexpr_schema.facts import AT, HOLDING, NOTHING, FactKey, Value
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.requests import ReplanRequest
from keyexpr_schema.payloads.system import LARGEST_OVERTAKEN
from keyexpr_schema.payloads.tasks import ReportState, TaskState
from keyexpr_schema.payloads.world import Fact, Statement
from tests.support.fleet_model import BOTH, FleetModel, fleet
from tests.support.household import bring, manipulator


def test_a_failed_task_leads_to_a_new_revision_with_finished_work_kept() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.succeed(model.orders()[0])
    (pick,) = model.orders()
    model.fail(pick)
    entry = model.plans["plan-1"]
    assert entry.plan.revision == 2
    assert entry.records["t1"].state is TaskState.SUCCEEDED
    assert entry.records["t2"].state is TaskState.FAILED
    assert "it slipped" in (entry.records["t2"].reason or "")
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_task_that_always_fails_ends_its_goal_with_the_reason() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    for _ in range(10 * MAX_REPLANS):
        for order in model.orders():
            if order.skill == "pick":
                model.fail(order)
            else:
                model.succeed(order)
    status = model.goal_states["g1"]
    assert status.state is GoalState.FAILED
    assert "it slipped" in (status.reason or "")
    assert model.orders() == []


def test_an_interrupted_attempt_that_was_done_counts_and_is_not_given_again() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.succeed(model.orders()[0])
    model.interrupt(model.orders()[0], done=True)
    assert model.plans["plan-1"].records["t2"].state is TaskState.SUCCEEDED
    assert model.orders()[0].skill == "navigate"


def test_an_interrupted_attempt_that_was_not_done_is_given_as_a_new_attempt() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.interrupt(model.orders()[0], done=False)
    (order,) = model.orders()
    assert (order.task, order.attempt) == ("t1", 2)


def test_a_worker_that_ends_gets_no_order_while_it_is_away() -> None:
    """Its token goes a moment after its last report; what it did is done by whoever is there."""
    model = fleet()
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    model.start(order)
    model.report(order, ReportState.INTERRUPTED, reason="stopped", leaving=True)
    assert model.orders() == []
    assert model.plans["plan-1"].records[order.task].state is TaskState.WAITING
    model.receive(events.WorkerDisconnected, robot=order.robot, incarnation="i1")
    assert model.orders() == []
    model.receive(events.WorkerConnected, robot=order.robot, incarnation="i2")
    # What an earlier run had said when it ended, said again for a store that lost it.
    model.receive(events.ReportReceived, report=model.reports[-1])
    assert [(o.task, o.attempt) for o in model.orders()] == [(order.task, 2)]


def test_reports_of_old_attempts_change_nothing_but_facts() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    model.interrupt(order, done=False)
    before = model.plans
    model.report(order, ReportState.FAILED, reason="late news")
    model.report(order, ReportState.SUCCEEDED)
    assert model.plans == before


def failing_picks(model: FleetModel, retryable: bool) -> list[str]:
    """The robots that have tried to pick something up, each of which has failed."""
    tried = []
    while orders := model.orders():
        if orders[0].skill == "pick":
            tried.append(orders[0].robot)
            model.fail(orders[0], "the gripper is jammed", retryable)
        else:
            model.succeed(orders[0])
    return tried


def test_what_is_not_worth_another_try_is_tried_by_another_robot_and_by_nobody_twice() -> None:
    model = FleetModel((manipulator("r1"), manipulator("r2")), cups=1)
    model.plan(bring(1, "hallway"))
    assert sorted(failing_picks(model, retryable=False)) == ["r1", "r2"]
    status = model.goal_states["g1"]
    assert status.state is GoalState.FAILED
    assert "the gripper is jammed" in (status.reason or "")


def test_what_is_worth_another_try_is_tried_again_after_planning() -> None:
    model = FleetModel((manipulator("r1"),), cups=1)
    model.plan(bring(1, "hallway"))
    assert failing_picks(model, retryable=True) == ["r1"] * MAX_FAILURES


def test_a_failure_that_the_facts_explain_is_planned_around() -> None:
    model = FleetModel((manipulator("r1"),), cups=1)
    model.plan(bring(1, "hallway"))
    while (order := model.orders()[0]).skill != "pick":
        model.succeed(order)
    gone = Fact(subject="cup_1", relation="at", value=None, source="r1", time_s=model.time_s)
    model.start(order)
    model.report(order, ReportState.FAILED, reason="not here", retryable=False, facts=(gone,))
    model.learn("cup_1", "at", "kitchen")
    model.finish_cancelling()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_person_who_wants_another_plan_has_perhaps_put_things_right() -> None:
    model = FleetModel((manipulator("r1"),), cups=2)
    model.plan(*BOTH)
    while (order := model.orders()[0]).skill != "pick":
        model.succeed(order)
    model.late = True
    model.fail(order, "the gripper is jammed", retryable=False)
    model.receive(
        events.ReplanRequested,
        request=ReplanRequest(request="x", plan="plan-1", reason="I have oiled it"),
    )
    del model.answers[0]
    job = model.state.plans["plan-1"].job
    assert job is not None
    model.receive(events.PlanningFailed, job=job.job, reason="no way")
    model.finish()
    assert [model.goal_state(goal) for goal in ("g1", "g2")] == [GoalState.REACHED] * 2


def test_a_refusal_of_a_planner_that_began_anew_costs_no_attempt() -> None:
    """Its store and its journal are lost, and the robots have had orders of a higher epoch."""
    model = fleet()
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    for _ in range(2 * MAX_FAILURES):
        model.report(order, ReportState.REFUSED, fence=7)
    assert model.orders() == [order]
    model.receive(events.EpochRaised, epoch=8)
    assert model.orders() == [replace(order, epoch=8)]
    model.report(order, ReportState.REFUSED, fence=7)  # what was on its way
    assert model.orders() == [replace(order, epoch=8)]
    model.receive(events.EpochRaised, epoch=3)
    assert model.state.epoch == 8
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_refusal_with_an_epoch_that_no_planner_takes_one_above_is_one_of_the_attempt() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    model.report(order, ReportState.REFUSED, fence=LARGEST_OVERTAKEN + 1)
    assert [again.attempt for again in model.orders()] == [order.attempt + 1]


def _said(subject: str, relation: str, value: Value, time_s: float, source: str = "r1") -> Fact:
    return Fact(subject=subject, relation=relation, value=value, source=source, time_s=time_s)


def _carrying() -> FleetModel:
    """`r1` has the first cup in its hand, and stands in the kitchen with it."""
    model = FleetModel((manipulator("r1"),), cups=1)
    model.plan(bring(1, "hallway"))
    while model.state.facts[FactKey(AT, "cup_1")].value != "r1":
        model.succeed(model.orders()[0])
    model.learn("r1", "at", "kitchen")
    return model


def test_what_a_report_says_is_with_a_robot_whose_hand_was_seen_empty_later_is_lost() -> None:
    """Its hand had opened when the task was cancelled. The cup would count as in its basket, and a
    goal for it as reached as soon as the robot drives there."""
    model = _carrying()
    (order,) = model.orders()
    model.start(order)
    then_s = model.time_s
    model.receive(events.GoalDeleted, goal="g1")
    for order in model.orders():
        facts = (_said("r1", "holding", "nothing", then_s + 1), _said("cup_1", "at", "r1", then_s))
        for fact in facts:
            model.receive(events.FactPut, fact=fact)
        model.report(order, ReportState.CANCELLED, facts=facts)
    assert model.state.facts[FactKey(AT, "cup_1")].value is None
    statement = Statement(statement="s", text="The cup 1 is in the kitchen", said_s=model.time_s)
    model.receive(events.StatementPut, statement=statement)
    assert model.state.facts[FactKey(AT, "cup_1")].value == "kitchen"


def test_what_a_robot_says_is_in_its_basket_is_there() -> None:
    model = _carrying()
    (order,) = model.orders()
    model.start(order)
    facts = (
        _said("r1", "holding", "nothing", model.time_s),
        _said("cup_1", "at", "r1", model.time_s),
    )
    model.report(order, ReportState.FAILED, reason="it let go", facts=facts)
    assert model.state.facts[FactKey(AT, "cup_1")].value == "r1"


@pytest.mark.parametrize("said", ["the robot r1 holds nothing", None])
def test_what_a_person_says_a_hand_holds_no_more_is_where_nobody_knows(said: str | None) -> None:
    model = _carrying()
    if said is None:
        model.learn("r1", "holding", "nothing")
    else:
        told = Statement(statement="s", text=said, said_s=model.time_s)
        model.receive(events.StatementPut, statement=told)
        assert model.state.statement_states["s"].reason is None
    assert model.state.facts[FactKey(AT, "cup_1")].value is None
    assert model.state.facts[FactKey(HOLDING, "r1")].value == NOTHING
