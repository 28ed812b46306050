"""Goals that nobody who is there can help with wait for robots, and go on when one comes."""

from __future__ import annotations

from fleet.core import events
from fleet.core.state import LOGIC, Policy
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import ReplanRequest
from tests.support.fleet_model import BOTH, FleetModel
from tests.support.household import bring, carrier, manipulator


def reason(model: FleetModel, goal: str = "g1") -> str:
    return model.state.goal_states[goal].reason or ""


def test_when_nobody_is_left_goals_wait_and_go_on_when_a_robot_comes_back() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    model.lose("hsr")
    assert model.goal_state("g1") is GoalState.WAITING
    assert "no robot is connected" in reason(model)
    assert model.state.plans["plan-1"].state is PlanState.RUNNING
    jobs = model.state.jobs
    model.learn("cup_1", "mass", "little")
    model.receive(events.TimerFired)
    assert model.state.jobs == jobs, "planned again though nothing has changed"
    model.return_("hsr")
    assert model.goal_state("g1") is GoalState.RUNNING
    model.cancelled(order)
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_what_a_plan_had_waited_for_is_no_reason_once_it_goes_on_or_has_ended() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.plan(bring(1, "hallway"))
    model.receive(events.HoldPut, hold=Hold(hold="h", kind=HoldKind.PAUSE, robots=("hsr",)))
    model.succeed(model.orders()[0])
    model.lose("hsr")
    entry = model.state.plans["plan-1"]
    assert "no robot is connected" in (entry.reason or "") and entry.waits_for_team is not None
    model.return_("hsr")
    model.receive(events.HoldDeleted, hold="h")
    entry = model.state.plans["plan-1"]
    assert (entry.reason, entry.violations, entry.waits_for_team) == (None, (), None)
    assert model.goal_state("g1") is GoalState.RUNNING
    model.finish()
    ended = model.plans["plan-1"]
    assert (ended.state, ended.reason, ended.violations) == (PlanState.SUCCEEDED, None, ())


def test_another_robot_that_comes_will_do() -> None:
    model = FleetModel((manipulator("r1"),), cups=1)
    model.plan(bring(1, "hallway"))
    model.lose("r1")
    assert model.goal_state("g1") is GoalState.WAITING
    model.receive(events.RobotRegistered, spec=manipulator("r2"))
    model.receive(events.WorkerConnected, robot="r2", incarnation="i1")
    model.learn("r2", "holding", "nothing")
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_robot_that_cannot_help_is_not_what_a_goal_waits_for() -> None:
    model = FleetModel((manipulator(), carrier()), cups=1)
    model.plan(bring(1, "hallway"))
    model.lose("hsr")
    assert model.goal_state("g1") is GoalState.WAITING
    assert "connected robots (locobot)" in reason(model)
    assert reason(model).endswith("; away: hsr")
    model.lose("locobot")
    model.return_("locobot")
    assert model.goal_state("g1") is GoalState.WAITING
    model.return_("hsr")
    for order in model.orders():
        if order.cancelled:
            model.cancelled(order)
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_what_no_robot_that_there_is_could_do_fails() -> None:
    model = FleetModel((manipulator(), manipulator("r2")), cups=1)
    model.plan(bring(1, "hallway"))
    weak = manipulator("r2", grip_kg=0.01)
    model.receive(events.RobotRegistered, spec=weak)
    model.receive(events.RobotUnregistered, robot="hsr")
    assert model.goal_state("g1") is GoalState.FAILED


def test_goals_that_others_can_do_go_on_without_those_that_wait() -> None:
    strong = manipulator("strong", grip_kg=3.0)
    model = FleetModel((strong, manipulator("weak", grip_kg=0.2)), cups=2)
    heavy = model.state.objects["cup_2"].__class__(
        object="cup_2", kind="cup", label="cup 2", ordinal=2, mass_kg=2.0
    )
    model.receive(events.ObjectPut, object=heavy)
    model.plan(*BOTH)
    model.lose("strong")
    assert model.goal_state("g1") is GoalState.RUNNING
    assert model.goal_state("g2") is GoalState.WAITING
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    assert model.goal_state("g2") is GoalState.WAITING
    model.return_("strong")
    for order in model.orders():
        model.cancelled(order)
    model.finish()
    assert model.goal_state("g2") is GoalState.REACHED


def test_where_goals_are_planned_by_themselves_they_wait_for_the_first_robot() -> None:
    model = FleetModel((), cups=1)
    model.receive(
        events.PlannerStarted, epoch=2, incarnation="x", policy=Policy(auto_plan=True), logic=LOGIC
    )
    model.receive(events.GoalPut, goal=bring(1, "hallway"))
    assert model.goal_state("g1") is GoalState.WAITING
    model.receive(events.RobotRegistered, spec=manipulator())
    model.receive(events.WorkerConnected, robot="hsr", incarnation="i1")
    model.learn("hsr", "holding", "nothing")
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_person_can_have_it_tried_again() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.plan(bring(1, "hallway"))
    model.lose("hsr")
    jobs = model.state.jobs
    request = ReplanRequest(request="again", plan="plan-1", reason="try")
    model.receive(events.ReplanRequested, request=request)
    assert model.state.jobs > jobs
    assert "no robot is connected" in model.replies["again"].sentence
    assert model.goal_state("g1") is GoalState.WAITING
