"""What is over leaves the state, and is archived; nothing of it is retracted."""

from __future__ import annotations

import msgspec
from msgspec.structs import replace

from fleet.core import events
from fleet.core.effects import Archive, Publish, Retract, effects_of
from fleet.core.state import State
from fleet.core.step import step
from fleet.core.table import decode_table, encode_table
from keyexpr_schema.keyspace import GOAL_STATUS, ORDER, PLAN_STATUS, TASK_RECORD
from keyexpr_schema.payloads.goals import GoalAddress, GoalState
from keyexpr_schema.payloads.history import GoalRecord, PlanRecord, RequestRecord
from keyexpr_schema.payloads.plans import PlanAddress, PlanState
from keyexpr_schema.payloads.tasks import TaskAddress, TaskState
from tests.support.fleet_model import BOTH, FleetModel, fleet
from tests.support.household import bring, carrier, manipulator


def plan_record(model: FleetModel, plan: str) -> PlanRecord:
    (record,) = (r for r in model.past if isinstance(r, PlanRecord) and r.spec.plan == plan)
    return record


def test_a_plan_that_ends_leaves_with_its_goals_and_all_answers() -> None:
    model = fleet()
    model.plan(*BOTH)
    model.finish()
    state = model.state
    assert (len(state.plans), len(state.goals), len(state.goal_states)) == (0, 0, 0)
    assert len(state.answers) == 0
    record = plan_record(model, "plan-1")
    assert record.status.state is PlanState.SUCCEEDED
    assert [goal.status.state for goal in record.goals] == [GoalState.REACHED] * 2
    assert {goal.spec for goal in record.goals} == set(BOTH)
    assert {task.state for task in record.tasks} == {TaskState.SUCCEEDED}
    assert all(len(task.tries) == 0 and task.ended_s is not None for task in record.tasks)
    assert record.begun_s < record.ended_s
    assert record.begun_wall_s < record.ended_wall_s
    (answered,) = (r for r in model.past if isinstance(r, RequestRecord))
    assert answered.answer.accepted


def test_its_keys_keep_their_last_values() -> None:
    model = fleet()
    model.plan(*BOTH)
    model.finish()
    assert not [e for e in model.effects if isinstance(e, Retract) and e.key is not ORDER]
    documents = model.documents
    assert documents[PLAN_STATUS.build(PlanAddress("plan-1"))].state is PlanState.SUCCEEDED
    assert documents[GOAL_STATUS.build(GoalAddress("g1"))].state is GoalState.REACHED
    for task in plan_record(model, "plan-1").tasks:
        assert documents[TASK_RECORD.build(TaskAddress("plan-1", task.task))] == task


def test_it_is_archived_before_anything_else_is_done() -> None:
    model = fleet()
    model.plan(*BOTH)
    model.finish()
    number = next(
        n
        for n, e in enumerate(model.effects)
        if isinstance(e, Archive) and isinstance(e.record, PlanRecord)
    )
    ended = [
        n
        for n, e in enumerate(model.effects)
        if isinstance(e, Publish) and getattr(e.payload, "state", None) is PlanState.SUCCEEDED
    ]
    assert min(ended) > number


def test_a_failed_plan_stays_until_the_last_worker_has_spoken() -> None:
    model = fleet()
    model.plan(*BOTH)
    first, second = model.orders()
    for goal in ("g1", "g2"):
        model.receive(events.GoalDeleted, goal=goal)
    assert all(order.cancelled for order in model.orders())
    model.cancelled(first)
    assert "plan-1" in model.state.plans
    model.cancelled(second)
    assert "plan-1" not in model.state.plans
    assert plan_record(model, "plan-1").status.state is PlanState.CANCELLED


def test_a_goal_that_fails_by_itself_leaves_before_its_plan() -> None:
    model = FleetModel((manipulator(), manipulator("r2")), cups=2)
    model.plan(*BOTH)
    while "g1" in model.state.goals:
        records = model.state.plans["plan-1"].records
        model.fail(next(o for o in model.orders() if records[o.task].goal == "g1"))
    (record,) = (r for r in model.past if isinstance(r, GoalRecord))
    assert record.spec.goal == "g1"
    assert record.status.state is GoalState.FAILED
    assert record.status.plan == "plan-1"
    assert "given up after" in (record.status.reason or "")
    assert model.documents[GOAL_STATUS.build(GoalAddress("g1"))] == record.status
    model.finish()
    assert [goal.spec.goal for goal in plan_record(model, "plan-1").goals] == ["g2"]


def test_a_rejected_goal_is_over_when_it_is_deleted() -> None:
    model = fleet()
    dragon = replace(bring(1, "hallway"), goal="dragon", conditions=(), text="Bring the dragon.")
    model.receive(events.GoalPut, goal=dragon)
    assert model.state.goal_states["dragon"].state is GoalState.REJECTED
    assert model.past == []
    model.receive(events.GoalDeleted, goal="dragon")
    (record,) = model.past
    assert isinstance(record, GoalRecord)
    assert record.deleted
    assert record.status.state is GoalState.REJECTED
    assert GOAL_STATUS.build(GoalAddress("dragon")) not in model.documents


def test_what_stayed_under_an_earlier_logic_leaves_when_a_run_with_this_one_begins() -> None:
    model = FleetModel((manipulator(), carrier()), cups=2, logic=1)
    model.plan(*BOTH)
    model.finish()
    assert list(model.state.plans) == ["plan-1"]
    assert model.past == []
    kept = model.state
    started = events.PlannerStarted(
        epoch=2, incarnation="two", logic=2, time_s=model.time_s, wall_time_s=model.wall_s
    )
    state, effects = step(kept, started)
    assert (len(state.plans), len(state.goals), len(state.answers)) == (0, 0, 0)
    archived = [e.record for e in effects if isinstance(e, Archive)]
    assert {type(record) for record in archived} == {PlanRecord, RequestRecord}
    assert not [e for e in effects if isinstance(e, Retract)]


def test_a_snapshot_of_the_event_that_ended_a_plan_archives_it_again() -> None:
    """Where the planner is killed before the archive has it, the snapshot still says so."""
    model = fleet()
    model.plan(bring(1, "hallway"))
    while not isinstance(model.past[-1], PlanRecord):
        model.succeed(model.orders()[0])
    data = msgspec.msgpack.encode(model.state.bare(), enc_hook=encode_table)
    state = msgspec.msgpack.decode(data, type=State, dec_hook=decode_table)
    records = [e.record for e in effects_of(state) if isinstance(e, Archive)]
    assert records == [model.past[-1]]
