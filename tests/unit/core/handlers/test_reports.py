"""Workers' reports in the core: failures, interruptions, late ones."""

from __future__ import annotations

from fleet.core.revision.replanning import MAX_REPLANS
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.tasks import ReportState, TaskState
from tests.support.fleet_model import fleet
from tests.support.household import bring


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


def test_reports_of_old_attempts_change_nothing_but_facts() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    model.interrupt(order, done=False)
    before = model.plans
    model.report(order, ReportState.FAILED, reason="late news")
    model.report(order, ReportState.SUCCEEDED)
    assert model.plans == before
