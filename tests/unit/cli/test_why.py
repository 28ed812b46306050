"""`robotctl why` follows reasons to their end, in sentences."""

from __future__ import annotations

import io
import os
import time
from collections.abc import Iterator, Mapping

import msgspec
import pytest
from msgspec.structs import replace

from cli.client.fleet_view import FleetView
from cli.client.health import Health
from cli.overview.needs import needs_of
from cli.overview.situation import Filters, Situation
from cli.times import iso
from cli.views.console import console
from cli.views.why import why_page
from cli.why.chain import explain
from cli.why.deletions import deleted_for
from fleet.core import events
from fleet.core.state import LOGIC, Policy
from keyexpr_schema.payloads.audit import AuditAction, AuditEntry
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.goals import Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.requests import Control, ControlRequest
from keyexpr_schema.payloads.robots import RobotActivity, RobotState
from keyexpr_schema.payloads.schedules import ScheduleState, ScheduleStatus
from keyexpr_schema.payloads.stops import Stop
from keyexpr_schema.payloads.system import Diagnostic, UndecodableValue
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState
from keyexpr_schema.payloads.waits import WaitKind, WaitReason
from tests.support.battery_fleet import BatteryFleet, powered
from tests.support.fleet_model import FleetModel
from tests.support.fleet_views import view_of
from tests.support.household import bring, manipulator

PLAN = "plan-1"
AT_ONE, AT_TWO = "1 Jan 1970 01:00", "1 Jan 1970 02:00"


@pytest.fixture(autouse=True)
def in_utc() -> Iterator[None]:
    before = os.environ.get("TZ")
    os.environ["TZ"] = "UTC"
    time.tzset()
    yield
    os.environ.pop("TZ")
    if before is not None:
        os.environ["TZ"] = before
    time.tzset()


THERE = Health(planning=True)


def told(
    view: FleetView,
    name: str,
    health: Health = THERE,
    deletions: Mapping[str, AuditEntry] | None = None,
) -> list[str]:
    file = io.StringIO()
    console(file).print(why_page(explain(view, name, health, deletions)))
    return file.getvalue().splitlines()


def test_from_a_goal_to_a_pause_of_the_robot_that_another_plan_has_for_it() -> None:
    """Goal, plan, task, the robot that is busy, what it does, and what holds that."""
    model = FleetModel((manipulator(),), cups=2)
    model.plan(bring(1, "hallway"))
    model.plan(bring(2, "living_room"))
    hold = Hold(
        hold="h1",
        kind=HoldKind.PAUSE,
        robots=("hsr",),
        by="ana",
        reason="lunch",
        wall_time_s=7200.0,
    )
    stop = Stop(stop="s1", by="bob", reason="a fall", wall_time_s=3600.0)
    model.receive(events.HoldPut, hold=hold)
    model.receive(events.StopPut, stop=stop)
    lines = told(view_of(model), "g2")
    assert lines[0] == "goal g2 is worked on in plan-2: 0 of its 4 tasks are done"
    assert lines[1].startswith("  because plan-2/t1 navigate(to=kitchen) by hsr waits")
    resume = "(`robotctl resume --robot hsr`)"
    stopped = f"because hsr is held by emergency stop s1 by bob (a fall), given {AT_ONE} {resume}"
    assert lines[2:] == [
        f"    {stopped}",
        f"    because hsr: paused by ana (lunch), since {AT_TWO} {resume}",
        "    because hsr is busy",
        "      because plan-1/t1 navigate(to=kitchen) is ordered of hsr since 1 Jan 1970 00:16",
        f"        {stopped}",
    ]


def test_what_is_closed_is_opened_by_its_name_and_a_reason_of_the_plan_is_told_once() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.plan(bring(1, "hallway"))
    view = view_of(model)
    shut = Closure(closure="c1", names=("kitchen_door", "kitchen"), reason="wet")
    nobody = WaitReason(kind=WaitKind.NO_ROBOT, plan=PLAN, sentence="hsr does not get to kitchen")
    closed = WaitReason(kind=WaitKind.CLOSED, robot="hsr", closure="c1", sentence=str(shut))
    view.closures["c1"] = shut
    view.plan_status[PLAN] = replace(view.plan_status[PLAN], waits_for=(nobody,))
    first = view.tasks[PLAN, "t1"]
    waits = replace(first, state=TaskState.WAITING, waits_for=(nobody, closed))
    view.tasks[PLAN, "t1"] = waits
    assert told(view, PLAN)[1:] == [
        "  because hsr does not get to kitchen",
        "  because plan-1/t1 navigate(to=kitchen) by hsr waits",
        f"    because hsr does not get there: {closed} (`robotctl world open kitchen_door`)",
    ]
    assert "because hsr does not get to kitchen" in told(view, f"{PLAN}/t1")[1]


def test_an_order_that_its_robot_does_not_take_up_is_told_with_what_the_robot_says() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.plan(bring(1, "hallway"))
    view = view_of(model)
    idle = RobotState(
        robot="hsr", incarnation="i1", activity=RobotActivity.IDLE, place="hallway", time_s=1.0
    )
    view.robot_states["hsr"] = idle
    assert told(view, f"{PLAN}/t1") == [
        "plan-1/t1 navigate(to=kitchen) is ordered of hsr since 1 Jan 1970 00:16; hsr says that it "
        "has begun nothing: it is idle"
    ]
    busy = replace(idle, activity=RobotActivity.BUSY, plan=PLAN, task="t1")
    view.robot_states["hsr"] = busy
    assert told(view, f"{PLAN}/t1")[0].endswith("since 1 Jan 1970 00:16")


def test_an_order_that_its_worker_cannot_read_and_one_without_a_lease_say_so() -> None:
    """What the worker says of the order counts, as long as the planner sees the robot there."""
    model = FleetModel((manipulator(),), cups=1)
    model.plan(bring(1, "hallway"))
    view = view_of(model)
    reason = "the value is version 2 of order, but this program knows versions up to 1: update it"
    where = "robots/hsr/orders/plan-1/t1"
    reject = UndecodableValue(component="worker-hsr", keyexpr=where, reason=reason)
    other = replace(reject, keyexpr="robots/hsr/orders/plan-1/t11")
    lines = told(view, f"{PLAN}/t1", Health(planning=True, undecodable=(reject, other)))
    assert lines[1:] == [f"  because hsr cannot read its order (worker-hsr says: {reason})"]

    lease = WaitReason(kind=WaitKind.LEASE, robot="hsr", plan=PLAN, task="t1")
    state = RobotState(
        robot="hsr", incarnation="i1", activity=RobotActivity.IDLE, waits_for=(lease,)
    )
    view.robot_states["hsr"] = state
    ordered = "plan-1/t1 navigate(to=kitchen) is ordered of hsr since 1 Jan 1970 00:16"
    waits = "  because hsr waits for a lease from the planner, without which it does not move"
    assert told(view, f"{PLAN}/t1") == [ordered, waits]
    wrong = Diagnostic(component="planner", check="charge", sentence="it is not said", since_s=0.0)
    assert told(view, f"{PLAN}/t1", Health(diagnostics=(wrong,)))[1:] == [
        waits,
        "    because no planner is connected (`robotctl planner`)",
        "    because planner: it is not said",
    ]
    situation = Situation(view, Filters.of(plans=[PLAN]), Health(undecodable=(reject, other)))
    (running,) = situation.running
    assert [each.kind for each in running.waits_for] == [WaitKind.UNREADABLE, WaitKind.LEASE]
    assert [each.about for each in needs_of(situation)] == [(where,)]

    model.receive(events.WorkerDisconnected, robot="hsr", incarnation="i1")
    view.tasks = view_of(model).tasks
    lines = told(view, f"{PLAN}/t1")
    assert len(lines) == 2 and lines[1].startswith("  because hsr is away since ")


def test_who_waits_for_a_charger_hears_what_keeps_the_one_that_is_there() -> None:
    fleet = BatteryFleet((powered(manipulator("a")), powered(manipulator("b"))), cups=1)
    for robot, percent in (("a", 5), ("b", 10)):
        fleet.learn(robot, "at", "hallway")
        fleet.learn(robot, "charge", percent)
    while ways := [order for order in fleet.orders() if order.skill != "charge"]:
        fleet.succeed(ways[0])
    fleet.receive(events.StopPut, stop=Stop(stop="s", by="bob", robots=("a",)))
    (waits,) = [goal for goal in fleet.state.goal_states if "-b-" in goal]
    lines = told(view_of(fleet), waits)
    assert "    because a is charging" in lines
    assert any("a is held by emergency stop s by bob" in line for line in lines)


def test_what_is_for_later_says_until_what_and_when() -> None:
    until = WaitReason(kind=WaitKind.CONDITION, sentence="the first cup is in the kitchen")
    due = WaitReason(kind=WaitKind.DUE, due_s=90.0)
    rows = ScheduleStatus(
        schedule="g2", state=ScheduleState.ACTIVE, next="1970-01-01T01:00:00+00:00", next_s=90.0
    )
    view = FleetView(
        goal_status={
            "g1": GoalStatus(goal="g1", state=GoalState.PENDING, waits_for=(until,)),
            "g2": GoalStatus(goal="g2", state=GoalState.STANDING, waits_for=(due,)),
        },
    )
    assert told(view, "g1")[1] == "  because it waits until the first cup is in the kitchen"
    assert told(view, "g2")[1] == "  because it is due mission 90.0 s"
    view.schedule_status["g2"] = rows
    assert told(view, "g2")[1].startswith(f"  because it is due {AT_ONE}")


def test_a_circle_is_cut() -> None:
    first = TaskRecord(
        plan="p",
        revision=1,
        task="a",
        skill="s",
        args={},
        actor="x",
        robot="r",
        state=TaskState.WAITING,
        waits_for=(WaitReason(kind=WaitKind.TASK, plan="p", task="b"),),
    )
    other = replace(
        first, task="b", waits_for=(WaitReason(kind=WaitKind.TASK, plan="p", task="a"),)
    )
    view = FleetView(tasks={("p", "a"): first, ("p", "b"): other})
    assert told(view, "p/a") == [
        "p/a s() by r waits",
        "  because p/b s() by r waits",
        "    because p/a s() is waiting, as said above",
    ]


def test_what_has_ended_says_why_and_what_was_never_there_is_nothing() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.plan(bring(1, "hallway"))
    model.finish()
    view = view_of(model)
    (line,) = told(view, "g1")
    assert line.startswith("goal g1 was reached 1 Jan 1970 00:16")
    (line,) = told(view, PLAN)
    assert line.startswith("plan plan-1 succeeded")
    (line,) = told(view, "plan-1/t1")
    assert "was done by hsr" in line and "which took" in line
    assert explain(view, "g7", THERE) == explain(view, "plan-1/t99", THERE) == []


def test_an_approval_a_question_and_a_plan_nobody_asked_for_say_what_to_do() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.receive(
        events.PlannerStarted,
        epoch=2,
        incarnation="x",
        policy=Policy(approval=True),
        logic=LOGIC,
    )
    model.receive(events.GoalPut, goal=bring(1, "hallway"))
    lines = told(view_of(model), "g1")
    assert lines[1] == "  because nobody has asked for a plan (`robotctl plan create`)"
    view = view_of(model)
    refused = WaitReason(kind=WaitKind.NO_PLAN, sentence="the door is closed")
    view.goal_status["g1"] = replace(view.goal_status["g1"], waits_for=(refused,))
    [_, again] = told(view, "g1")
    assert again == "  because it has no plan: the door is closed (`robotctl plan create`)"
    model.plan()
    lines = told(view_of(model), "g1")
    assert lines[1] == "  because plan plan-1 (revision 1) is proposed: 0 of its 4 tasks are done"
    assert lines[2] == (
        "    because a person has to approve plan plan-1 (`robotctl plan approve plan-1`)"
    )


def test_a_plan_that_is_being_cancelled_says_who_has_cancelled_it() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.plan(bring(1, "hallway"))
    [order] = model.orders()
    model.start(order)
    ask = ControlRequest(request="r1", control=Control.CANCEL, plan=PLAN, by="ana")
    model.receive(events.ControlRequested, request=ask)
    done = "0 of its 4 tasks are done"
    who = "ana has cancelled plan plan-1"
    assert told(view_of(model), PLAN)[0] == f"plan plan-1 (revision 1) runs: {done}: {who}"
    goal = f"goal g1 is worked on in plan-1: {done}; plan-1 is being cancelled: {who}"
    assert told(view_of(model), "g1")[0] == goal


def test_a_plan_whose_goal_was_deleted_says_who_has_deleted_it_as_long_as_it_is_told_of() -> None:
    model = FleetModel((manipulator(),), cups=2)
    model.plan(bring(1, "hallway"))
    model.plan(bring(2, "living_room"))
    assert deleted_for(view_of(model), PLAN) == []
    [order] = model.orders()
    model.start(order)
    model.receive(events.GoalDeleted, goal="g1")
    said = AuditEntry(
        at="",
        wall_time_s=3600.0,
        time_s=3600.0,
        by="ana",
        action=AuditAction.DELETED,
        key="goals/g1/spec",
        summary="deleted goal g1",
    )

    def lines() -> list[str]:
        view = view_of(model)
        assert (deleted_for(view, PLAN), deleted_for(view, "plan-2")) == (["g1"], [])
        return told(view, PLAN, deletions={"g1": said})

    who = f"  because goal g1 was deleted {AT_ONE} by ana"
    assert lines()[1] == who
    model.cancelled(order)
    assert lines()[1:] == [who]


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (TaskState.SUCCEEDED, "was done by r: why"),
        (TaskState.FAILED, "failed: why"),
        (TaskState.CANCELLED, "was cancelled: why"),
        (TaskState.ORDERED, "is ordered of r"),
        (TaskState.RUNNING, "is being done by r"),
    ],
)
def test_a_task_of_which_nobody_knows_since_when_says_nothing_of_it(
    state: TaskState, said: str
) -> None:
    record = TaskRecord(
        plan="p",
        revision=1,
        task="a",
        skill="s",
        args={},
        actor="x",
        robot="r",
        state=state,
        reason="why",
    )
    assert told(FleetView(tasks={("p", "a"): record}), "p/a") == [f"p/a s() {said}"]


def test_as_json_each_link_has_its_kind_and_since_when() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.plan(bring(1, "hallway"))
    model.receive(events.WorkerDisconnected, robot="hsr", incarnation="i1")
    (task,) = msgspec.to_builtins(explain(view_of(model), "plan-1/t1", THERE))
    assert (task["kind"], task["state"], task["about"]) == ("task", "ordered", "plan-1/t1")
    (away,) = task["because"]
    assert away["kind"] == "away"
    assert away["since"] == iso(model.wall_s)


def test_goals_that_wait_for_each_other_are_told_with_what_ends_that() -> None:
    model = FleetModel((manipulator(),), cups=1)
    one, other = bring(1, "hallway").conditions, bring(1, "living_room").conditions
    for name, wants, when in (("g1", one, other), ("g2", other, one)):
        goal = Goal(goal=name, text="", conditions=wants, when=when)
        model.receive(events.GoalPut, goal=goal)
    lines = "\n".join(told(view_of(model), "g1"))
    assert "goal g2 is pending" in lines
    assert "goal g1 waits for this in turn: by themselves none of them is ever begun" in lines
    assert "robotctl goal delete g1" in lines


def test_a_closed_door_is_told_before_that_nobody_has_asked_for_a_plan() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.learn("hsr", "at", "kitchen")
    closure = Closure(closure="c1", names=("living_room",), by="ana", reason="wet floor")
    model.receive(events.ClosurePut, closure=closure)
    model.plan(bring(1, "living_room"))
    view = view_of(model)
    view.closures[closure.closure] = closure
    lines = told(view, "g1")
    door = next(n for n, line in enumerate(lines) if "no robot gets there" in line)
    asks = next(n for n, line in enumerate(lines) if "plan create" in line)
    assert door < asks and any("robotctl world open" in line for line in lines)
