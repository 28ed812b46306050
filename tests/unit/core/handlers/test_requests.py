"""What people ask for: plans, replans, control of plans, and the answers they get."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.state import Policy
from keyexpr_schema.keyspace import PLAN_STATUS
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import Plan, PlanAddress, PlanState, Task
from keyexpr_schema.payloads.requests import Control, ControlRequest, ReplanRequest
from keyexpr_schema.payloads.tasks import ReportState, TaskState
from tests.support.fleet_model import BOTH, FleetModel, fleet
from tests.support.household import bring


def control_of(model: FleetModel, plan: str, name: str, what: Control) -> bool:
    """Whether the planner accepts this request."""
    request = ControlRequest(request=name, control=what, plan=plan)
    model.receive(events.ControlRequested, request=request)
    return model.replies[name].accepted


def test_a_ready_plan_waits_for_start_and_can_be_cancelled_and_deleted() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"), start=False)
    assert model.orders() == []
    assert model.goal_state("g1") is GoalState.PLANNED

    def control(name: str, what: Control) -> bool:
        return control_of(model, "plan-1", name, what)

    assert control("c1", Control.START)
    (order,) = model.orders()
    assert not control("c2", Control.DELETE)
    assert control("c3", Control.CANCEL)
    assert [o.cancelled for o in model.orders()] == [True]
    model.report(order, ReportState.CANCELLED)
    cancelled = model.documents["plans/plan-1/status"]
    assert (cancelled.state, cancelled.reason) == (
        PlanState.CANCELLED,
        "somebody has cancelled plan plan-1",
    )
    assert model.goal_state("g1") is GoalState.WAITING
    model.plan(start=False)
    assert control_of(model, "plan-2", "c4", Control.DELETE)
    assert not [key for key in model.documents if key.startswith("plans/plan-2/")]


def test_who_has_cancelled_a_plan_first_is_told_with_its_goals() -> None:
    """Whatever comes while its robots come to rest."""
    model = fleet()
    model.plan(*BOTH)
    orders = model.orders()
    said = []
    for name, reason in (("ana", "wet floor"), ("bob", "")):
        ask = ControlRequest(
            request=name, control=Control.CANCEL, plan="plan-1", by=name, reason=reason
        )
        model.receive(events.ControlRequested, request=ask)
        said.append(model.replies[name].sentence)
    model.receive(events.GoalDeleted, goal="g1")
    why, first, *others = "ana has cancelled plan plan-1 (wet floor)", *orders
    going = "plan plan-1 is being cancelled"
    assert said == [going, f"{going} already: {why}"]
    assert others
    model.fail(first)
    cancelled = model.documents["plans/plan-1/status"]
    assert (cancelled.state, cancelled.reason) == (PlanState.RUNNING, why)
    for order in others:
        model.report(order, ReportState.CANCELLED)
    cancelled = model.documents["plans/plan-1/status"]
    assert (cancelled.state, cancelled.reason) == (PlanState.CANCELLED, why)
    assert model.goal_states["g2"].reason == why


def test_a_task_can_be_added_to_a_running_plan() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    request = ControlRequest(
        request="c", control=Control.ADD_TASK, plan="plan-1", skill="navigate",
        args={"to": "living_room"}, robot="locobot",
    )  # fmt: skip
    model.receive(events.ControlRequested, request=request)
    model.finish()
    entry = model.plans["plan-1"]
    assert entry.state is PlanState.SUCCEEDED
    assert entry.records["t5"].robot == "locobot"
    assert entry.records["t5"].state is TaskState.SUCCEEDED


def test_a_task_that_cannot_be_added_leaves_the_plan_as_it_was() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    request = ControlRequest(
        request="c", control=Control.ADD_TASK, plan="plan-1", skill="fly", args={}
    )
    model.receive(events.ControlRequested, request=request)
    model.finish()
    entry = model.plans["plan-1"]
    assert entry.state is PlanState.SUCCEEDED
    assert "there is no skill fly" in model.replies["c"].sentence
    assert not model.replies["c"].accepted


def test_a_plan_that_someone_proposes_is_checked_like_any_other() -> None:
    model = fleet()
    go = Task(task="t1", skill="navigate", args={"robot": "?a1", "to": "kitchen"}, actor="a1")
    good = Plan(plan="mine", goals=(), conditions=(), tasks=(go,))
    model.receive(events.PlanProposed, plan=good)
    model.finish()
    assert model.plans["mine"].state is PlanState.SUCCEEDED
    grab = Task(task="t1", skill="grab", args={"robot": "?a1"}, actor="a1")
    bad = Plan(plan="yours", goals=(), conditions=(), tasks=(grab,))
    model.receive(events.PlanProposed, plan=bad)
    status = model.plans["yours"]
    assert status.state is PlanState.REJECTED
    assert status.violations[0].code == "unknown-skill"


def test_a_plan_that_is_proposed_is_the_first_revision_whatever_it_says() -> None:
    model = fleet()
    go = Task(task="t1", skill="navigate", args={"robot": "?a1", "to": "kitchen"}, actor="a1")
    good = Plan(plan="mine", revision=4, goals=(), conditions=(), tasks=(go,))
    model.receive(events.PlanProposed, plan=good)
    model.finish()
    assert (model.plans["mine"].state, model.plans["mine"].plan.revision) == (
        PlanState.SUCCEEDED,
        1,
    )
    bad = replace(good, plan="yours", tasks=(replace(go, skill="grab"),))
    model.receive(events.PlanProposed, plan=bad)
    assert model.plans["yours"].state is PlanState.REJECTED


def test_wrong_requests_are_answered_with_the_reason() -> None:
    model = fleet()
    model.plan(goals=("nothing",))
    assert "there is no goal nothing" in model.replies["r0"].sentence
    model.plan()
    assert "no goal that waits" in model.replies["r1"].sentence
    model.plan(*BOTH)
    model.plan(goals=("g1",))
    assert "already in plan plan-1" in model.replies["r3"].sentence
    replan = ReplanRequest(request="x", plan="nope", reason="because")
    model.receive(events.ReplanRequested, request=replan)
    assert "known are plan-1" in model.replies["x"].sentence


def test_a_plan_waits_for_approval_where_the_policy_says_so() -> None:
    model = fleet()
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=Policy(approval=True))
    model.plan(bring(1, "hallway"))
    assert model.plans["plan-1"].state is PlanState.PROPOSED
    assert model.orders() == []
    approve = ControlRequest(request="a", control=Control.APPROVE, plan="plan-1", by="ana@lab")
    model.receive(events.ControlRequested, request=approve)
    model.finish()
    status = model.documents[PLAN_STATUS.build(PlanAddress("plan-1"))]
    assert status.approved_by == "ana@lab"
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_dry_run_shows_the_plan_and_leaves_nothing_behind() -> None:
    model = fleet()
    model.plan(*BOTH, dry_run=True)
    answer = model.replies["r0"]
    assert answer.preview is not None
    assert len(answer.preview.tasks) == 9
    assert answer.preview_status is not None
    assert set(answer.preview_status.allocation.values()) == {"hsr", "locobot"}
    assert model.plans == {}
    assert model.state.previews == {}
    assert model.goal_state("g1") is GoalState.WAITING


def test_a_person_may_call_a_request_what_she_likes() -> None:
    model = fleet()
    for number in range(1, 10):
        model.plan(goals=("nothing",), request=f"auto-{number}")
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=Policy(auto_plan=True))
    model.receive(events.GoalPut, goal=bring(1, "hallway"))
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
