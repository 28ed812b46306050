"""Whatever waits says for what, as data that follow every change."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.state import LOGIC, Policy
from keyexpr_schema.keyspace import GOAL_STATUS, PLAN_STATUS, TASK_RECORD
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.goals import Goal, GoalAddress, GoalState
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.plans import Plan, PlanAddress, Task
from keyexpr_schema.payloads.requests import Control, ControlRequest
from keyexpr_schema.payloads.stops import Stop
from keyexpr_schema.payloads.tasks import TaskAddress
from keyexpr_schema.payloads.waits import WaitKind, WaitReason
from tests.support.fleet_model import FleetModel
from tests.support.household import bring, manipulator

PLAN = "plan-1"


def of_task(model: FleetModel, task: str, plan: str = PLAN) -> tuple[WaitReason, ...]:
    """What is published of a task."""
    return model.documents[TASK_RECORD.build(TaskAddress(plan, task))].waits_for


def of_goal(model: FleetModel, goal: str) -> tuple[WaitReason, ...]:
    return model.documents[GOAL_STATUS.build(GoalAddress(goal))].waits_for


def of_plan(model: FleetModel, plan: str = PLAN) -> tuple[WaitReason, ...]:
    return model.documents[PLAN_STATUS.build(PlanAddress(plan))].waits_for


def kinds(reasons: tuple[WaitReason, ...]) -> list[WaitKind]:
    return [reason.kind for reason in reasons]


def one_robot(cups: int = 1) -> FleetModel:
    return FleetModel((manipulator(),), cups=cups)


def tasks(model: FleetModel, plan: str = PLAN) -> list[str]:
    return [task.task for task in model.state.plans[plan].plan.tasks]


def test_a_task_waits_for_those_before_it_and_for_none_of_them_once_they_are_done() -> None:
    model = one_robot()
    model.plan(bring(1, "hallway"))
    first, second, *_ = tasks(model)
    assert of_task(model, first) == ()
    assert of_task(model, second) == (WaitReason(kind=WaitKind.TASK, plan=PLAN, task=first),)
    model.succeed(model.orders()[0])
    assert of_task(model, second) == ()


def test_a_goal_that_nobody_has_planned_says_so_and_one_in_a_plan_names_it() -> None:
    model = one_robot()
    model.receive(events.GoalPut, goal=bring(1, "hallway"))
    assert kinds(of_goal(model, "g1")) == [WaitKind.NO_PLAN]
    model.late = True
    model.plan()
    assert of_goal(model, "g1") == (WaitReason(kind=WaitKind.PLAN, plan=PLAN),)
    assert kinds(of_plan(model)) == [WaitKind.REVISION]
    model.answer()
    assert of_goal(model, "g1") == of_plan(model) == ()
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    assert of_goal(model, "g1") == ()


def test_a_robot_that_works_for_one_plan_is_what_another_waits_for() -> None:
    model = one_robot(cups=2)
    model.plan(bring(1, "hallway"))
    model.plan(bring(2, "living_room"))
    first, then, *_ = tasks(model)
    mine = tasks(model, "plan-2")[0]
    busy = WaitReason(kind=WaitKind.BUSY, robot="hsr", plan=PLAN, task=first)
    assert of_task(model, mine, "plan-2") == (busy,)
    model.succeed(model.orders()[0])
    (reason,) = of_task(model, mine, "plan-2")
    assert (reason.kind, reason.task) == (WaitKind.BUSY, then)
    while model.orders() and model.orders()[0].plan == PLAN:
        model.succeed(model.orders()[0])
    assert of_task(model, mine, "plan-2") == ()


def test_a_robot_that_is_away_is_named_with_since_when_and_so_it_is_for_what_it_does() -> None:
    model = one_robot(cups=2)
    model.plan(bring(1, "hallway"))
    model.plan(bring(2, "living_room"))
    first, mine = tasks(model)[0], tasks(model, "plan-2")[0]
    model.receive(events.WorkerDisconnected, robot="hsr", incarnation="i1")
    since_s = model.state.wall_time_s
    away = WaitReason(kind=WaitKind.AWAY, robot="hsr", since_wall_s=since_s)
    assert of_task(model, first) == (away,)
    assert away in of_task(model, mine, "plan-2")
    model.receive(events.TimerFired)
    assert of_task(model, first) == (away,), "changed by the mere passing of time"
    model.return_("hsr")
    assert of_task(model, first) == ()


def test_stops_holds_and_drains_are_named_by_their_keys() -> None:
    model = one_robot()
    hold = Hold(hold="h1", kind=HoldKind.PAUSE, robots=("hsr",), reason="cleaning")
    model.receive(events.HoldPut, hold=hold)
    model.receive(events.StopPut, stop=Stop(stop="s1", reason="a fall"))
    model.plan(bring(1, "hallway"))
    first = tasks(model)[0]
    stopped = WaitReason(kind=WaitKind.STOPPED, robot="hsr", stop="s1", sentence="a fall")
    paused = WaitReason(kind=WaitKind.PAUSED, robot="hsr", hold="h1", sentence="cleaning")
    assert of_task(model, first) == (stopped, paused)
    model.receive(events.StopDeleted, stop="s1")
    assert of_task(model, first) == (paused,)
    model.receive(events.HoldPut, hold=Hold(hold="h2", kind=HoldKind.PAUSE, plans=(PLAN,)))
    model.receive(events.HoldDeleted, hold="h1")
    assert of_task(model, first) == of_plan(model)
    assert [(r.kind, r.hold, r.plan) for r in of_plan(model)] == [(WaitKind.PAUSED, "h2", PLAN)]
    model.receive(events.HoldDeleted, hold="h2")
    assert of_task(model, first) == of_plan(model) == ()


def test_a_robot_that_is_drained_is_named_beside_what_it_still_does() -> None:
    model = FleetModel((manipulator(),), cups=2)
    model.plan(bring(1, "hallway"))
    model.plan(bring(2, "living_room"))
    drain = Hold(hold="d", kind=HoldKind.DRAIN, robots=("hsr",), reason="a new battery")
    model.succeed(model.orders()[0])
    model.receive(events.HoldPut, hold=drain)
    mine = tasks(model, "plan-2")[0]
    named = WaitReason(kind=WaitKind.DRAINED, robot="hsr", hold="d", sentence="a new battery")
    assert of_task(model, mine, "plan-2")[-1] == named
    assert kinds(of_task(model, mine, "plan-2")) == [WaitKind.BUSY, WaitKind.DRAINED]


def test_approval_and_start_are_what_a_plan_and_its_tasks_wait_for() -> None:
    model = one_robot()
    policy = Policy(approval=True)
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=policy, logic=LOGIC)
    model.plan(bring(1, "hallway"), start=False)
    approval = WaitReason(kind=WaitKind.APPROVAL, plan=PLAN)
    assert of_plan(model) == of_task(model, tasks(model)[0]) == (approval,)
    assert of_goal(model, "g1") == (WaitReason(kind=WaitKind.PLAN, plan=PLAN),)
    approve = ControlRequest(request="a", plan=PLAN, control=Control.APPROVE)
    model.receive(events.ControlRequested, request=approve)
    assert of_plan(model) == (WaitReason(kind=WaitKind.START, plan=PLAN),)
    start = ControlRequest(request="s", plan=PLAN, control=Control.START)
    model.receive(events.ControlRequested, request=start)
    assert of_plan(model) == of_task(model, tasks(model)[0]) == ()


def test_while_a_plan_is_made_again_what_that_touches_names_the_revision_and_the_reason() -> None:
    model = one_robot()
    model.plan(bring(1, "hallway"))
    model.late = True
    model.learn("cup_1", "at", "living_room")
    model.succeed(model.orders()[0])
    found = [reason for task in tasks(model) for reason in of_task(model, task)]
    (revision,) = (reason for reason in found if reason.kind is WaitKind.REVISION)
    assert (revision.plan, revision.revision) == (PLAN, 2)
    assert "at(cup_1) = kitchen" in (revision.sentence or "")
    model.answer()
    found = [reason for task in tasks(model) for reason in of_task(model, task)]
    assert {reason.kind for reason in found} == {WaitKind.TASK}


def test_goals_that_only_a_robot_which_is_not_there_could_reach_wait_for_a_robot() -> None:
    model = one_robot()
    model.plan(bring(1, "hallway"))
    model.lose("hsr")
    assert of_goal(model, "g1") == (WaitReason(kind=WaitKind.PLAN, plan=PLAN),)
    (reason,) = of_plan(model)
    assert reason.kind is WaitKind.NO_ROBOT
    assert "no robot is connected" in (reason.sentence or "")
    model.return_("hsr")
    assert of_goal(model, "g1") == ()


def test_an_order_that_a_lost_robot_may_have_carried_out_is_what_others_wait_for() -> None:
    model = FleetModel((manipulator("r1"), manipulator("r2")), cups=1)
    model.plan(bring(1, "hallway"))
    model.succeed(model.orders()[0])
    (order,) = model.orders()
    model.lose(order.robot)
    while drives := model.wanted():
        model.succeed(drives[0])
    (pick, *_) = model.state.plans[PLAN].index.ready["cup_1"]
    lost = WaitReason(kind=WaitKind.LOST, robot=order.robot, plan=PLAN, task=order.task)
    assert of_task(model, pick) == (lost,)
    model.return_(order.robot)
    assert kinds(of_task(model, pick)) == [WaitKind.CANCELLING]
    model.cancelled(model.orders()[0])
    assert of_task(model, pick) == ()


def test_a_goal_for_later_names_its_time_and_one_under_a_condition_what_has_to_hold() -> None:
    model = one_robot()
    later = Goal(goal="g1", text="", conditions=bring(1, "hallway").conditions, not_before_s=5000.0)
    model.receive(events.GoalPut, goal=later)
    (due,) = of_goal(model, "g1")
    assert (due.kind, due.due_s) == (WaitKind.DUE, 5000.0)
    when = Goal(
        goal="g2",
        text="",
        conditions=bring(1, "hallway").conditions,
        when=bring(1, "living_room").conditions,
    )
    model.receive(events.GoalPut, goal=when)
    (condition,) = of_goal(model, "g2")
    assert condition.kind is WaitKind.CONDITION
    assert "living room" in (condition.sentence or "")
    model.learn("cup_1", "at", "living_room")
    assert WaitKind.CONDITION not in kinds(of_goal(model, "g2"))


def test_of_many_tasks_before_it_the_last_eight_are_named() -> None:
    model = one_robot()
    drives = [
        Task(
            task=f"d{number}",
            skill="navigate",
            args={"robot": "?a1", "to": ("hallway", "kitchen")[number % 2]},
            actor="a1",
            after=(f"d{number - 1}",) if number else (),
        )
        for number in range(12)
    ]
    last = replace(drives[0], task="last", after=tuple(each.task for each in drives))
    plan = Plan(plan="p", goals=(), conditions=(), tasks=(*drives, last))
    model.receive(events.PlanProposed, plan=plan)
    assert [reason.task for reason in of_task(model, "last", "p")] == [
        f"d{number}" for number in range(4, 12)
    ]
    model.succeed(model.orders()[0])
    assert len(of_task(model, "last", "p")) == 8


def test_a_waiting_reason_reads_as_a_phrase_in_every_kind() -> None:
    for kind in WaitKind:
        reason = WaitReason(
            kind=kind, plan="p", task="t", goal="g", robot="r", revision=2, closure="hall"
        )
        assert str(reason)


def test_a_way_that_somebody_has_closed_is_named_by_its_closure() -> None:
    model = one_robot()
    model.learn("hsr", "at", "kitchen")
    model.plan(bring(1, "living_room"))
    way = tasks(model)[-2]
    model.succeed(model.orders()[0])
    model.receive(events.HoldPut, hold=Hold(hold="h1", kind=HoldKind.PAUSE, robots=("hsr",)))
    model.succeed(model.orders()[0])
    model.late = True
    closure = Closure(closure="c1", names=("living_room",), by="ana", reason="wet floor")
    model.receive(events.ClosurePut, closure=closure)
    (closed, *others) = of_task(model, way)
    assert (closed.kind, closed.closure, closed.robot) == (WaitKind.CLOSED, "c1", "hsr")
    assert closed.sentence == "living_room is closed by ana (wet floor)"
    assert [each.kind for each in others] == [WaitKind.REVISION, WaitKind.PAUSED]
    model.receive(events.ClosureDeleted, closure="c1")
    assert WaitKind.CLOSED not in kinds(of_task(model, way))


def test_a_stop_and_a_pause_that_are_put_again_for_others_let_the_first_ones_go() -> None:
    model = one_robot()
    model.receive(events.StopPut, stop=Stop(stop="s1", robots=("hsr",)))
    model.receive(events.HoldPut, hold=Hold(hold="h1", kind=HoldKind.PAUSE, robots=("hsr",)))
    model.plan(bring(1, "hallway"))
    first = tasks(model)[0]
    assert kinds(of_task(model, first)) == [WaitKind.STOPPED, WaitKind.PAUSED]
    model.receive(events.HoldPut, hold=Hold(hold="h1", kind=HoldKind.PAUSE, robots=("other",)))
    assert kinds(of_task(model, first)) == [WaitKind.STOPPED]
    model.receive(events.StopPut, stop=Stop(stop="s1", robots=("other",)))
    assert of_task(model, first) == ()
    assert [order.task for order in model.orders()] == [first]


def test_a_pause_of_all_is_said_of_a_robot_that_is_not_registered_any_more_too() -> None:
    model = one_robot()
    model.plan(bring(1, "hallway"), start=False)
    first = tasks(model)[0]
    model.receive(events.RobotUnregistered, robot="hsr")
    model.receive(events.HoldPut, hold=Hold(hold="h1", kind=HoldKind.PAUSE))
    assert WaitKind.PAUSED in kinds(of_task(model, first))


def test_a_goal_that_a_closure_keeps_from_everybody_names_that_before_it_has_no_plan() -> None:
    model = one_robot()
    model.learn("hsr", "at", "kitchen")
    closure = Closure(closure="c1", names=("living_room",), by="ana", reason="wet floor")
    model.receive(events.ClosurePut, closure=closure)
    model.plan(bring(1, "living_room"))
    closed, unplanned = of_goal(model, "g1")
    assert (closed.kind, closed.closure, closed.robot) == (WaitKind.CLOSED, "c1", None)
    assert unplanned.kind is WaitKind.NO_PLAN
    model.learn("hsr", "at", "living_room")
    assert kinds(of_goal(model, "g1")) == [WaitKind.NO_PLAN]
    model.learn("hsr", "at", "kitchen")
    assert WaitKind.CLOSED in kinds(of_goal(model, "g1"))
    model.receive(events.ClosureDeleted, closure="c1")
    assert kinds(of_goal(model, "g1")) == [WaitKind.NO_PLAN]


def test_who_wants_what_a_goal_waits_for_is_named_until_it_is_deleted() -> None:
    model = one_robot()
    one, other = bring(1, "hallway"), bring(1, "living_room")
    first = Goal(goal="g1", text="", conditions=one.conditions, when=other.conditions)
    model.receive(events.GoalPut, goal=first)
    assert kinds(of_goal(model, "g1")) == [WaitKind.CONDITION]
    second = Goal(goal="g2", text="", conditions=other.conditions, when=one.conditions)
    model.receive(events.GoalPut, goal=second)
    for name, wants in (("g1", "g2"), ("g2", "g1")):
        _, who = of_goal(model, name)
        assert (who.kind, who.goal) == (WaitKind.GOAL, wants)
    model.receive(events.GoalDeleted, goal="g2")
    assert kinds(of_goal(model, "g1")) == [WaitKind.CONDITION]


def test_what_the_planner_wants_itself_waits_for_the_plan_that_is_being_made() -> None:
    model = one_robot(cups=2)
    model.plan(bring(1, "hallway"))
    model.succeed(model.orders()[0])
    model.succeed(model.orders()[0])
    model.late = True
    model.plan(bring(2, "hallway"))
    model.receive(events.GoalDeleted, goal="g1")
    (order,) = model.orders()
    model.cancelled(order)
    (waits,) = of_goal(model, "put-down-cup_1")
    assert (waits.kind, waits.plan) == (WaitKind.PLAN, "plan-2")
    model.finish()
    assert model.goal_state("put-down-cup_1") is GoalState.REACHED
