"""Ordering goes on while a plan is made again, with whatever the reason does not touch."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from fleet.core import events
from fleet.core.plan_entry import PlanEntry
from fleet.core.state import Policy
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import Control, ControlRequest, ReplanRequest
from keyexpr_schema.payloads.tasks import Order, TaskState
from tests.support.fleet_model import FleetModel
from tests.support.household import bring, cup, manipulator

ROOMS = ("hallway", "living_room")


def running(robots: int, cups: int) -> FleetModel:
    """A plan is carried out, and from now on planning takes a while."""
    model = FleetModel(tuple(manipulator(f"r{n}") for n in range(1, robots + 1)), cups)
    model.plan(*(bring(n, ROOMS[n % 2]) for n in range(1, cups + 1)))
    model.late = True
    return model


def entry(model: FleetModel) -> PlanEntry:
    return model.plans["plan-1"]


def order_of(model: FleetModel, robot: str) -> Order | None:
    return next((order for order in model.orders() if order.robot == robot), None)


def work(model: FleetModel, tasks: int) -> int:
    """Robots do what they are told, as far as there is something; how much that was."""
    for done in range(tasks):
        if not (orders := model.orders()):
            return done
        model.succeed(orders[done % len(orders)])
    return tasks


def a_goal_comes_up(model: FleetModel) -> None:
    policy = Policy(auto_plan=True)
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=policy)
    model.receive(events.ObjectPut, object=cup(9))
    model.learn("cup_9", "at", "living_room")
    model.receive(events.GoalPut, goal=bring(9, "hallway"))


def a_task_is_added(model: FleetModel) -> None:
    request = ControlRequest(
        request="c", control=Control.ADD_TASK, plan="plan-1", skill="navigate",
        args={"to": "living_room"},
    )  # fmt: skip
    model.receive(events.ControlRequested, request=request)


def a_robot_joins(model: FleetModel) -> None:
    model.receive(events.RobotRegistered, spec=manipulator("r9"))
    model.receive(events.WorkerConnected, robot="r9", incarnation="i1")
    model.learn("r9", "holding", "nothing")


def a_robot_is_lost(model: FleetModel) -> None:
    model.lose("r2")


NEWS = (a_goal_comes_up, a_task_is_added, a_robot_joins, a_robot_is_lost)


@pytest.mark.parametrize("what", NEWS)
@pytest.mark.parametrize("done", [1, 2, 4, 9])
def test_robots_work_on_while_a_plan_is_made_and_nothing_is_done_twice(
    what: Callable[[FleetModel], None], done: int
) -> None:
    model = running(robots=3, cups=7)
    what(model)
    assert entry(model).job is not None
    assert work(model, done) == done
    assert model.met["ordered while a plan was made"] > 0
    before = {r.task: r for r in entry(model).records.values() if r.state is not TaskState.WAITING}
    model.finish_cancelling()
    assert entry(model).state is PlanState.SUCCEEDED
    assert entry(model).plan.revision > 1
    states = {status.state for status in model.goal_states.values()}
    assert states == {GoalState.REACHED}
    records = entry(model).records
    done_at_last = [r for r in records.values() if r.state is TaskState.SUCCEEDED]
    picked = [record.args["object"] for record in done_at_last if record.skill == "pick"]
    assert sorted(picked) == sorted(set(picked)), "picked twice"
    for name, record in before.items():
        if record.robot != "r2" or what is not a_robot_is_lost:
            assert records[name] in done_at_last, "healthy work was cancelled"


def test_a_plan_that_does_without_what_was_given_out_meanwhile_is_made_again() -> None:
    model = running(robots=3, cups=7)
    a_robot_is_lost(model)
    work(model, 9)
    asked_for = entry(model).job
    model.answer()
    assert model.met["discarded"] == 1
    assert entry(model).plan.revision == 1
    again = entry(model).job
    assert again is not None
    assert asked_for is not None
    assert again.takes_up == asked_for.takes_up, "the reason was lost with the plan"
    model.finish_cancelling()
    assert entry(model).state is PlanState.SUCCEEDED


def test_a_person_who_wants_another_plan_holds_everything_else_up() -> None:
    model = running(robots=2, cups=2)
    request = ReplanRequest(request="x", plan="plan-1", reason="I say so")
    model.receive(events.ReplanRequested, request=request)
    assert work(model, 9) == 2, "what had begun, and nothing more"
    model.finish()
    assert entry(model).state is PlanState.SUCCEEDED


def test_the_goal_of_a_task_that_failed_waits_and_the_others_do_not() -> None:
    model = running(robots=2, cups=4)
    order = order_of(model, "r1")
    assert order is not None
    goal = entry(model).records[order.task].goal
    model.fail(order)
    work(model, 6)
    begun = {r.goal for r in entry(model).records.values() if r.state is TaskState.SUCCEEDED}
    assert goal not in begun
    assert len(begun) > 1
    model.finish()
    assert all(s.state is GoalState.REACHED for s in model.goal_states.values())


def test_goals_are_reached_while_a_plan_is_made() -> None:
    model = running(robots=2, cups=2)
    a_task_is_added(model)
    work(model, 99)
    assert model.goal_state("g1") is model.goal_state("g2") is GoalState.REACHED
    assert entry(model).state is PlanState.RUNNING, "there is still the task to add"
    model.finish()
    assert entry(model).state is PlanState.SUCCEEDED
