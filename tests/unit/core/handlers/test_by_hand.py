"""What somebody has done by hand is believed, and robots leave it."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fleet.core import events
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import Answer, Control, ControlRequest
from keyexpr_schema.payloads.tasks import ReportState, TaskRecord, TaskState
from tests.support.fleet_model import FleetModel, fleet
from tests.support.household import bring, fact


def done(model: FleetModel, task: str, plan: str = "plan-1", /) -> Answer:
    request = f"done-{len(model.journal)}"
    ask = ControlRequest(
        request=request,
        control=Control.TASK_DONE,
        plan=plan,
        task=task,
        by="ana@lab",
        reason="it was in the way",
    )
    model.receive(events.ControlRequested, request=ask)
    return model.replies[request]


def the_task(model: FleetModel, skill: str, cup: str = "cup_1") -> TaskRecord:
    records = model.state.plans["plan-1"].records.values()
    return next(r for r in records if r.skill == skill and cup in r.args.values())


def test_the_last_task_done_by_hand_reaches_the_goal_and_nobody_moves_any_more() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    orders = model.orders()
    placed = the_task(model, "place")
    answer = done(model, placed.task)
    assert answer.accepted
    assert answer.sentence == (
        f"task {placed.task} of plan plan-1 is done by hand by ana@lab (it was in the way)"
    )
    fact = model.state.fact("at", "cup_1")
    assert fact is not None
    assert (fact.value, fact.source, fact.by) == ("hallway", "person", "ana@lab")
    assert all(order.cancelled for order in model.orders()) and len(model.orders()) == len(orders)
    model.finish_cancelling()
    entry = model.plans["plan-1"]
    assert (entry.state, model.goal_state("g1")) == (PlanState.SUCCEEDED, GoalState.REACHED)
    record = entry.records[placed.task]
    assert (record.state, record.attempt) == (TaskState.SUCCEEDED, 0)
    assert record.reason == "done by hand by ana@lab (it was in the way)"


@pytest.mark.parametrize(
    "state",
    [ReportState.CANCELLED, ReportState.FAILED, ReportState.SUCCEEDED, ReportState.INTERRUPTED],
)
def test_a_robot_that_is_at_it_leaves_off_and_the_task_is_done_however_that_goes(
    state: ReportState,
) -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    while not (picks := [o for o in model.wanted() if o.skill == "pick"]):
        model.succeed(model.wanted()[0])
    (pick,) = picks
    model.start(pick)
    answer = done(model, pick.task)
    assert answer.accepted and answer.sentence.endswith("; hsr is told to leave off")
    assert next(o for o in model.orders() if o.task == pick.task).cancelled
    assert not model.wanted(), "the robot gets nothing else before it has left off"
    again = done(model, pick.task)
    assert not again.accepted and "is done by hand by ana@lab" in again.sentence
    model.crash()
    model.report(pick, state, reason="the hand is full", ended_s=model.time_s)
    record = model.state.plans["plan-1"].records[pick.task]
    assert (record.state, record.attempt) == (TaskState.SUCCEEDED, 1)
    assert record.reason == "done by hand by ana@lab (it was in the way)"
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    picked = [r for r in model.plans["plan-1"].records.values() if r.skill == "pick"]
    assert [r.task for r in picked] == [pick.task], "nobody picks it up once more"


def test_what_a_robot_finds_that_was_told_to_leave_off_is_reacted_to_at_once() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    while not (picks := [o for o in model.wanted() if o.skill == "pick"]):
        model.succeed(model.wanted()[0])
    (pick,) = picks
    model.start(pick)
    model.late = True
    assert done(model, pick.task).accepted
    model.answer()
    empty = replace(fact("hsr", "holding", "nothing", "hsr"), time_s=model.time_s)
    model.report(pick, ReportState.CANCELLED, facts=(empty,), ended_s=model.time_s)
    reasons = model.state.plans["plan-1"].open_reasons
    assert any("and hsr says otherwise" in reason.sentence for reason in reasons), reasons
    assert not model.wanted(), "nobody drives off with an empty hand"


def test_what_is_left_is_checked_and_goes_on_as_it_was_where_it_still_works() -> None:
    model = fleet()
    model.late = True
    model.plan(bring(1, "hallway"), bring(2, "hallway"))
    model.answer()
    first = next(iter(model.orders()))
    before = model.state.plans["plan-1"].plan
    assert done(model, first.task).accepted
    entry = model.state.plans["plan-1"]
    assert entry.job is not None and entry.job.reason is not None
    assert entry.job.reason.sentence == (
        f"{first.task} ({first.skill}) was done by hand by ana@lab (it was in the way)"
    )
    model.finish_cancelling()
    after = model.plans["plan-1"]
    assert {goal: model.goal_state(goal) for goal in ("g1", "g2")} == dict.fromkeys(
        ("g1", "g2"), GoalState.REACHED
    )
    assert {task.skill for task in before.tasks} == {r.skill for r in after.records.values()}


def test_what_nobody_can_do_by_hand_is_said() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    assert "has no task t99; its tasks are t1" in done(model, "t99").sentence
    assert "there is no plan plan-7" in done(model, "t1", "plan-7").sentence
    first = model.wanted()[0]
    model.succeed(first)
    assert done(model, first.task).sentence == f"task {first.task} of plan plan-1 is done already"
    failed = model.wanted()[0]
    model.fail(failed)
    assert "is failed: the plan goes on without it" in done(model, failed.task).sentence


def test_what_nobody_wants_any_more_is_not_done_by_hand() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"), bring(2, "hallway"))
    pick = the_task(model, "pick")
    model.late = True
    model.receive(events.GoalDeleted, goal="g1")
    answer = done(model, pick.task)
    assert not answer.accepted and "is for goal g1, which it no longer has" in answer.sentence
