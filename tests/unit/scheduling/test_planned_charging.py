"""Charging is work that planning puts in where a robot needs it."""

from __future__ import annotations

import re

import msgspec

from fleet.core import events
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import ReplanRequest
from keyexpr_schema.payloads.tasks import TaskRecord
from keyexpr_schema.payloads.world import Place
from tests.support.battery_fleet import CHARGER, SECOND, SMALL, BatteryFleet, powered
from tests.support.household import PLACES, bring, carrier, manipulator

ALL = [bring(number, "living_room") for number in (1, 2, 3, 4)]


def charges(fleet: BatteryFleet, plan: str = "plan-1") -> list[TaskRecord]:
    """The tasks of a plan by which robots charge."""
    return [r for r in fleet.state.plans[plan].current() if r.skill == "charge"]


def test_robots_charge_before_a_way_where_what_is_left_would_not_do() -> None:
    fleet = BatteryFleet(charge=(40.0, 90.0, 100.0))
    fleet.plan(*ALL)
    tasks = charges(fleet)
    assert [task.robot for task in tasks] == ["hsr", "hsr_2"]
    one, other = tasks
    assert one.task in other.after  # at one charger one after the other
    ways = {r.task: r for r in fleet.state.plans["plan-1"].current() if one.task in r.after}
    assert any(way.skill == "navigate" for way in ways.values())
    fleet.carry_on()
    # Nobody had to be sent to charge besides.
    assert fleet.charged == ["hsr", "hsr_2"] and list(fleet.plans) == ["plan-1"]
    assert {status.state for status in fleet.goal_states.values()} == {GoalState.REACHED}


def test_work_that_its_robot_would_have_to_charge_for_goes_to_another_if_that_is_sooner() -> None:
    fleet = BatteryFleet(charge=(30.0, 100.0, 100.0))
    fleet.plan(bring(1, "living_room"))
    assert charges(fleet) == []
    assert set(fleet.state.plans["plan-1"].outcome.allocation.values()) == {"hsr_2"}


def test_a_full_battery_is_not_charged_before_it_has_to_be() -> None:
    fleet = BatteryFleet()
    fleet.plan(bring(1, "living_room"))
    assert charges(fleet) == []


def test_what_the_charge_is_not_enough_for_is_refused_where_nobody_can_charge() -> None:
    fleet = BatteryFleet((powered(manipulator()), powered(carrier())), cups=4, charge=(40.0,))
    fleet.receive(events.ObjectDeleted, object="charger")
    fleet.plan(*ALL)
    plan = fleet.plans["plan-1"]
    assert plan.state is PlanState.REJECTED
    assert plan.reason is not None
    assert re.search(
        r": hsr has 0\.\d+ Wh, and t\d+ \(\w+\) needs 0\.\d+ Wh; charge first; locobot", plan.reason
    )


def test_no_battery_is_enough_for_a_task_that_takes_more_than_it_holds() -> None:
    tiny = msgspec.structs.replace(SMALL, capacity_wh=0.3)
    fleet = BatteryFleet((powered(manipulator(), tiny),), cups=1)
    fleet.plan(bring(1, "living_room"))
    reason = fleet.goal_states["g1"].reason
    assert reason is not None and "hsr's battery holds 0.3 Wh" in reason


def test_what_was_to_be_charged_is_decided_anew_with_each_revision() -> None:
    fleet = BatteryFleet(charge=(40.0, 40.0, 100.0))
    fleet.plan(*ALL[:2])
    assert charges(fleet)
    for robot in ("hsr", "hsr_2"):
        fleet.percent[robot] = 100.0
        fleet.learn(robot, "charge", 100)
    request = ReplanRequest(request="again", plan="plan-1", reason="they are full")
    fleet.receive(events.ReplanRequested, request=request)
    assert not charges(fleet)
    fleet.carry_on()
    assert fleet.least > 0.0


def test_two_chargers_are_both_used_in_one_plan() -> None:
    fleet = BatteryFleet(charge=(40.0, 40.0, 100.0), chargers=(CHARGER, SECOND))
    fleet.plan(*ALL)
    assert {task.args["charger"] for task in charges(fleet)} == {"charger", "charger_2"}
    fleet.carry_on()
    assert fleet.waited == 0 and fleet.least > 0.0
    assert {status.state for status in fleet.goal_states.values()} == {GoalState.REACHED}


def test_where_nobody_can_charge_the_work_goes_to_who_has_enough_for_it() -> None:
    fleet = BatteryFleet(cups=2, charge=(24.0, 100.0, 100.0))
    fleet.receive(events.ObjectDeleted, object="charger")
    fleet.plan(*ALL[:2])
    assert set(fleet.state.plans["plan-1"].outcome.allocation.values()) <= {"hsr_2", "locobot"}
    fleet.carry_on()
    assert {status.state for status in fleet.goal_states.values()} == {GoalState.REACHED}
    assert fleet.least > 0.0


def test_who_has_enough_for_half_of_the_work_leaves_the_rest_to_one_farther_off() -> None:
    large = msgspec.structs.replace(SMALL, capacity_wh=12.0)
    robots = powered(manipulator()), powered(manipulator("hsr_2"), large)
    fleet = BatteryFleet(robots, cups=2, charge=(80.0, 100.0), chargers=())
    for place in PLACES:
        to_m = {**place.travel_m, "attic": 70.0}
        fleet.receive(events.PlacePut, place=msgspec.structs.replace(place, travel_m=to_m))
    to_m = {place.place: 70.0 for place in PLACES}
    fleet.receive(events.PlacePut, place=Place(place="attic", label="attic", travel_m=to_m))
    fleet.learn("hsr_2", "at", "attic")
    fleet.plan(*ALL[:2])
    assert sorted(fleet.state.plans["plan-1"].outcome.allocation.values()) == ["hsr", "hsr_2"]
    fleet.carry_on()
    assert {status.state for status in fleet.goal_states.values()} == {GoalState.REACHED}
    assert fleet.least > 0.0
