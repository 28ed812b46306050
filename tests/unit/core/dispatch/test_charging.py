"""Robots below their reserve are sent to charge, and whoever cannot do a task is not ordered it."""

from __future__ import annotations

import msgspec
import pytest

from fleet.core import events
from fleet.core.state import Policy
from keyexpr_schema.payloads.goals import Condition, Goal, GoalState
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import Control, ControlRequest
from keyexpr_schema.payloads.world import Place
from tests.support.battery_fleet import CHARGER, SECOND, SMALL, BatteryFleet, powered
from tests.support.household import PLACES, SKILLS, bring, carrier, manipulator


def alone(charge: float) -> BatteryFleet:
    """One robot with a hand."""
    return BatteryFleet((powered(manipulator()),), cups=2, charge=(charge,))


def test_a_robot_below_its_reserve_is_sent_to_charge_and_has_no_other_work() -> None:
    fleet = alone(19.0)
    fleet.learn("hsr", "charge", 15)
    (order,) = fleet.orders()
    assert (order.skill, order.args["to"]) == ("navigate", "hallway")
    (goal,) = [g for g, s in fleet.goal_states.items() if s.state is GoalState.RUNNING]
    assert fleet.state.goals[goal].by == ("hsr",)
    fleet.plan(bring(1, "living_room"))
    assert fleet.orders() == [order]
    fleet.carry_on()
    assert fleet.charged == ["hsr"]
    assert {status.state for status in fleet.goal_states.values()} == {GoalState.REACHED}


def test_who_is_full_enough_is_left_alone() -> None:
    fleet = alone(100.0)
    fleet.learn("hsr", "charge", 20)
    assert fleet.orders() == [] and fleet.goal_states == {}


def test_without_a_charger_nobody_is_sent() -> None:
    fleet = alone(19.0)
    fleet.receive(events.ObjectDeleted, object="charger")
    fleet.learn("hsr", "charge", 15)
    assert fleet.orders() == []
    fleet.receive(events.ObjectPut, object=CHARGER)
    fleet.learn("hsr", "charge", 10)
    assert [order.skill for order in fleet.orders()] == ["navigate"]


def test_work_that_the_charge_is_not_enough_for_waits_until_it_is() -> None:
    fleet = alone(26.0)
    fleet.plan(bring(1, "living_room"))
    fleet.carry_on()
    assert fleet.charged == ["hsr"] and fleet.least > 0.0
    assert fleet.goal_state("g1") is GoalState.REACHED


def test_what_a_full_battery_is_not_enough_for_is_said() -> None:
    tiny = msgspec.structs.replace(SMALL, capacity_wh=0.6)
    fleet = BatteryFleet((powered(manipulator(), tiny),), cups=1)
    fleet.plan(bring(1, "living_room"))
    fleet.carry_on()
    status = fleet.goal_states["g1"]
    assert status.state in (GoalState.FAILED, GoalState.WAITING)
    assert fleet.least > 0.0


def test_the_emptiest_is_charged_first_and_one_at_a_time() -> None:
    robots = tuple(powered(manipulator(name)) for name in ("a", "b", "c"))
    fleet = BatteryFleet(robots, cups=1, charge=(18.0, 14.0, 16.0))
    for robot in ("a", "b", "c"):
        fleet.learn(robot, "at", "hallway")
        fleet.learn(robot, "charge", {"a": 15, "b": 5, "c": 10}[robot])
    assert not [order for order in fleet.orders() if order.skill == "charge"]
    fleet.carry_on()
    assert set(fleet.at_charger) == {1}
    assert sorted(fleet.charged) == ["a", "b", "c"]


def test_an_empty_robot_is_planned_with_no_more_until_somebody_has_charged_it() -> None:
    fleet = BatteryFleet((powered(manipulator()), powered(carrier())), cups=1)
    fleet.learn("hsr", "charge", 0)
    fleet.plan(bring(1, "living_room"))
    status = fleet.goal_states["g1"]
    assert status.state is GoalState.WAITING
    assert status.reason is not None and "the battery of hsr is empty" in status.reason
    fleet.learn("hsr", "charge", 50)
    fleet.plan()
    fleet.carry_on()
    assert fleet.goal_state("g1") is GoalState.REACHED


def test_charging_waits_for_nobody_to_approve_it() -> None:
    fleet = alone(19.0)
    fleet.receive(events.PlannerStarted, epoch=2, incarnation="two", policy=Policy(approval=True))
    fleet.learn("hsr", "charge", 15)
    assert [order.skill for order in fleet.orders()] == ["navigate"]
    fleet.plan(bring(1, "living_room"))
    fleet.carry_on()
    assert {entry.state for entry in fleet.plans.values()} == {
        PlanState.SUCCEEDED,
        PlanState.PROPOSED,
    }


def test_who_wants_a_robot_charged_that_is_sent_to_charge_gets_that() -> None:
    fleet = alone(19.0)
    fleet.learn("hsr", "charge", 15)
    full = Condition(relation="charge", subject="hsr", value=100)
    fleet.plan(Goal(goal="mine", text="", conditions=(full,)))
    fleet.carry_on()
    assert fleet.goal_state("mine") is GoalState.REACHED


def test_nobody_is_sent_to_charge_who_is_in_the_fleet_no_more() -> None:
    fleet = alone(19.0)
    fleet.learn("hsr", "charge", 15)
    assert len(fleet.state.goal_states) == 1
    fleet.receive(events.RobotUnregistered, robot="hsr")
    assert not fleet.state.goal_states


def test_a_planner_that_starts_again_goes_on_with_it() -> None:
    fleet = alone(19.0)
    fleet.learn("hsr", "charge", 15)
    fleet.receive(events.PlannerStarted, epoch=2, incarnation="two", skills=dict(SKILLS))
    fleet.carry_on()
    assert fleet.charged == ["hsr"]
    assert {status.state for status in fleet.goal_states.values()} == {GoalState.REACHED}


def test_an_empty_robot_is_not_sent_to_charge_and_works_on_when_somebody_has_charged_it() -> None:
    fleet = alone(100.0)
    hold = Hold(hold="lunch", kind=HoldKind.PAUSE, robots=())
    fleet.receive(events.HoldPut, hold=hold)
    fleet.plan(bring(1, "living_room"))
    fleet.percent["hsr"] = 0.0
    fleet.late = True
    fleet.learn("hsr", "charge", 0)
    fleet.receive(events.HoldDeleted, hold="lunch")
    while fleet.answers:
        fleet.answer()
    assert [*fleet.goal_states] == ["g1"]
    fleet.percent["hsr"] = 100.0
    fleet.late = False
    fleet.learn("hsr", "charge", 100)
    fleet.carry_on()
    assert fleet.goal_state("g1") is GoalState.REACHED


def sent_in_vain() -> BatteryFleet:
    """A robot that is to charge, and the planner found no way to the charger."""
    fleet = alone(19.0)
    fleet.late = True
    fleet.learn("hsr", "charge", 15)
    (answer,) = fleet.answers
    fleet.answers.clear()
    fleet.receive(events.PlanningFailed, job=answer.job, reason="there is no way to the charger")
    fleet.late = False
    (goal,) = fleet.goal_states
    assert fleet.goal_state(goal) is GoalState.WAITING
    return fleet


def test_charging_that_could_not_be_planned_is_planned_when_a_robot_comes() -> None:
    fleet = sent_in_vain()
    fleet.lose("hsr")
    fleet.return_("hsr")
    fleet.carry_on()
    assert {status.state for status in fleet.goal_states.values()} == {GoalState.REACHED}


def test_a_robot_that_is_charged_by_hand_meanwhile_has_what_was_wanted() -> None:
    fleet = sent_in_vain()
    fleet.learn("hsr", "charge", 100)
    assert {status.state for status in fleet.goal_states.values()} == {GoalState.REACHED}
    fleet.percent["hsr"] = 100.0
    fleet.plan(bring(1, "living_room"))
    fleet.carry_on()
    assert fleet.goal_state("g1") is GoalState.REACHED


@pytest.mark.parametrize("late", [False, True], ids=["while it runs", "while it is planned"])
def test_what_a_robot_whose_battery_runs_empty_was_to_do_goes_to_another(late: bool) -> None:
    fleet = BatteryFleet((powered(manipulator()), powered(manipulator("hsr_2"))), cups=1)
    fleet.late = late
    fleet.plan(bring(1, "living_room"))
    first = fleet.wanted()[0].robot if not late else "hsr"
    fleet.percent[first] = 0.0
    fleet.learn(first, "charge", 0)
    if not late:
        fleet.fail(fleet.wanted()[0], f"the battery of {first} is empty")
    fleet.carry_on()
    assert fleet.goal_state("g1") is GoalState.REACHED


def test_work_that_waits_for_a_robot_does_not_wait_until_somebody_has_charged_it() -> None:
    fleet = BatteryFleet((powered(manipulator()), powered(manipulator("hsr_2"))), cups=1)
    hold = Hold(hold="lunch", kind=HoldKind.PAUSE, robots=())
    fleet.receive(events.HoldPut, hold=hold)
    fleet.plan(bring(1, "living_room"))
    for robot in ("hsr", "hsr_2"):
        fleet.percent[robot] = 15.0
        fleet.learn(robot, "charge", 15)
    (first,) = fleet.plans["plan-1"].outcome.allocation.values()
    fleet.percent[first] = 0.0
    fleet.learn(first, "charge", 0)
    fleet.receive(events.HoldDeleted, hold="lunch")
    fleet.carry_on()
    assert fleet.goal_state("g1") is GoalState.REACHED


def test_charging_that_somebody_cancels_is_planned_again_as_the_robot_has_no_other_work() -> None:
    fleet = alone(19.0)
    fleet.learn("hsr", "charge", 15)
    (goal,) = fleet.goal_states
    (plan,) = fleet.plans
    request = ControlRequest(request="stop", control=Control.CANCEL, plan=plan)
    fleet.receive(events.ControlRequested, request=request)
    fleet.carry_on()
    fleet.carry_on()  # what the cancelled plan leaves behind, then the next
    assert fleet.goal_states[goal].state is GoalState.REACHED


@pytest.mark.parametrize("home", ["living_room", "hallway"])
@pytest.mark.parametrize("name", ["charger_2", "a_charger"])
def test_robots_that_are_low_share_the_chargers(name: str, home: str) -> None:
    robots = tuple(powered(manipulator(robot)) for robot in ("a", "b", "c", "d"))
    far = msgspec.structs.replace(CHARGER, object=name, home=home)
    fleet = BatteryFleet(robots, cups=1, charge=(18.0,) * 4, late=True, chargers=(CHARGER, far))
    for robot in "abcd":
        fleet.learn(robot, "charge", 15)
    # Nobody's plan is made yet, and each knows where those before it will go.
    fleet.carry_on()
    assert {charger: len(who) for charger, who in fleet.charged_at.items()} == {
        "charger": 2,
        name: 2,
    }
    assert set(fleet.at_charger) == {1} and fleet.least > 0.0


def test_who_is_sent_to_charge_goes_where_it_need_not_wait() -> None:
    robots = tuple(powered(manipulator(name)) for name in ("a", "b"))
    fleet = BatteryFleet(robots, cups=1, charge=(18.0, 18.0), chargers=(CHARGER, SECOND))
    fleet.learn("a", "charge", 15)
    fleet.learn("b", "charge", 15)
    assert {order.robot: order.args["to"] for order in fleet.orders()} == {
        "a": "hallway",
        "b": "living_room",
    }


def test_a_charger_that_is_free_later_may_still_be_the_sooner_one() -> None:
    robots = tuple(powered(manipulator(name)) for name in ("a", "b"))
    attic = Place(place="attic", label="attic", travel_m={p.place: 400.0 for p in PLACES})
    far = msgspec.structs.replace(CHARGER, object="charger_2", home="attic")
    fleet = BatteryFleet(robots, cups=1, charge=(18.0, 18.0), chargers=(CHARGER, far))
    for place in PLACES:
        far_m = {**place.travel_m, "attic": 400.0}
        fleet.receive(events.PlacePut, place=msgspec.structs.replace(place, travel_m=far_m))
    fleet.receive(events.PlacePut, place=attic)
    fleet.learn("a", "charge", 15)
    fleet.learn("b", "charge", 15)
    fleet.carry_on()
    assert {name: sorted(who) for name, who in fleet.charged_at.items()} == {"charger": ["a", "b"]}
