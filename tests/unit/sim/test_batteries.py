"""Batteries run down, fill and run empty alike in both simulated worlds."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from keyexpr_schema.payloads.motions import Motion, MotionKind, MotionOutcome, MotionState
from keyexpr_schema.payloads.robots import Battery, charge_step
from sim.backend import Backend
from sim.errors import BadFile
from sim.files.mission_file import Mission, load_mission
from sim.server.process import BACKENDS, make_backend

SMALL = Battery(capacity_wh=10, idle_w=10, driving_w=60, working_w=40, charging_w=600)


def mission(**charge: float) -> Mission:
    """Three robots with small batteries, and one charger."""
    loaded = load_mission("three-robots")
    robots = tuple(
        msgspec.structs.replace(
            robot,
            spec=msgspec.structs.replace(robot.spec, battery=SMALL),
            charge=charge.get(robot.spec.robot, 60.0),
        )
        for robot in loaded.robots
    )
    return msgspec.structs.replace(loaded, robots=robots)


@pytest.fixture(params=BACKENDS)
def world(request: pytest.FixtureRequest) -> Iterator[Backend]:
    yield make_backend(mission(), request.param, speed=1.0)


def charge(world: Backend, robot: str) -> float:
    percent = world.senses(robot).charge
    assert percent is not None
    return percent


def do(world: Backend, robot: str, kind: MotionKind, **fields: str) -> MotionOutcome:
    world.begin(robot, Motion(kind=kind, timeout_s=600.0, **fields))
    while world.is_running(robot):
        world.advance()
    outcome = world.outcome(robot)
    assert outcome is not None
    return outcome


def test_who_works_draws_more_than_who_stands_about(world: Backend) -> None:
    assert [charge(world, robot) for robot in world.robots] == [60.0, 60.0, 60.0]
    outcome = do(world, "hsr", MotionKind.GO_TO, place="kitchen")
    assert outcome.state is MotionState.SUCCEEDED
    seconds = world.time_s
    assert charge(world, "locobot") == pytest.approx(60.0 - 10.0 * seconds / 360.0, abs=0.02)
    # It drives nearly all the time, and else it works or stands about.
    used = 60.0 - charge(world, "hsr")
    assert 40.0 * seconds / 360.0 < used <= 60.0 * seconds / 360.0 + 0.02


def test_at_a_charger_a_battery_fills_and_one_robot_is_there_at_a_time(world: Backend) -> None:
    refill = Motion(kind=MotionKind.CHARGE, object="charger", timeout_s=600.0)
    world.begin("locobot", refill)
    while charge(world, "locobot") <= 60.0:
        world.advance()
    world.begin("hsr", refill)
    while world.is_running("locobot"):
        before = charge(world, "hsr")
        world.advance()
        assert charge(world, "hsr") <= before, "it charges beside one that does"
    done = world.outcome("locobot")
    assert done is not None and done.state is MotionState.SUCCEEDED
    assert charge(world, "locobot") > 90.0
    while world.is_running("hsr"):  # with physics, the other one makes room when it is full
        world.advance()
    outcome = world.outcome("hsr")
    assert outcome is not None
    expected = MotionState.SUCCEEDED if "mujoco" in type(world).__module__ else MotionState.FAILED
    assert outcome.state is expected, outcome.reason
    assert do(world, "locobot", MotionKind.GO_TO, place="kitchen").state is MotionState.SUCCEEDED
    assert do(world, "hsr", MotionKind.CHARGE, object="charger").state is MotionState.SUCCEEDED
    assert charge(world, "hsr") == pytest.approx(100.0, abs=0.01)


def test_an_empty_robot_stops_where_it_is_and_says_so(world: Backend) -> None:
    world.batteries.set_charge("hsr", 1.0)
    outcome = do(world, "hsr", MotionKind.GO_TO, place="kitchen")
    assert (outcome.state, outcome.senses.charge) == (MotionState.FAILED, 0.0)
    assert outcome.reason is not None and "battery of hsr is empty" in outcome.reason
    again = do(world, "hsr", MotionKind.CHARGE, object="charger")
    assert again.state is MotionState.FAILED and again.reason == outcome.reason
    world.batteries.set_charge("hsr", 50.0)
    assert do(world, "hsr", MotionKind.GO_TO, place="hallway").state is MotionState.SUCCEEDED


def test_what_cannot_be_charged_at_is_said(world: Backend) -> None:
    outcome = do(world, "hsr", MotionKind.CHARGE, object="sofa")
    assert outcome.reason == "sofa is no charger; there are charger"


def test_charging_takes_what_the_battery_lacks_and_is_stopped_at_any_time() -> None:
    world = make_backend(mission(), "kinematic")
    world.begin("locobot", Motion(kind=MotionKind.CHARGE, object="charger", timeout_s=600.0))
    while charge(world, "locobot") <= 60.0 and world.is_running("locobot"):
        world.advance()
    assert not world.is_running("locobot")  # it jumps to where the battery is full
    assert charge(world, "locobot") == pytest.approx(100.0, abs=0.01)
    stepping = make_backend(mission(), "kinematic", speed=1.0)
    stepping.begin("locobot", Motion(kind=MotionKind.CHARGE, object="charger", timeout_s=600.0))
    while charge(stepping, "locobot") <= 60.0:
        stepping.advance()
    stepping.stop("locobot")
    level = charge(stepping, "locobot")
    stepping.advance()
    assert charge(stepping, "locobot") < level


def test_a_robot_without_a_battery_never_runs_out() -> None:
    loaded = mission()
    robots = tuple(
        msgspec.structs.replace(robot, spec=msgspec.structs.replace(robot.spec, battery=None))
        for robot in loaded.robots
    )
    world = make_backend(msgspec.structs.replace(loaded, robots=robots), "kinematic")
    assert world.senses("hsr").charge is None
    outcome = do(world, "hsr", MotionKind.CHARGE, object="charger")
    assert outcome.reason == "hsr has no battery to charge"


def test_facts_say_the_nearest_step_and_zero_only_of_an_empty_battery() -> None:
    assert [charge_step(p) for p in (0.0, 0.2, 7.4, 7.6, 97.0, 98.0)] == [0, 1, 5, 10, 95, 100]


MISSION = """\
mission: low
world: home
robots:
  - spec: hsr
    start: {{at_m: [8.0, 3.0]}}
    {more}
"""


def test_a_mission_gives_its_robots_other_batteries_and_charges(tmp_path: Path) -> None:
    path = tmp_path / "low.yaml"
    small = "battery: {capacity_wh: 8, idle_w: 1, driving_w: 2, working_w: 3, charging_w: 4}"
    path.write_text(MISSION.format(more=f"charge: 30\n    {small}"))
    (robot,) = load_mission(path).robots
    assert robot.charge == 30.0
    assert robot.spec.battery is not None and robot.spec.battery.capacity_wh == 8.0


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("charge: 0", "charge"),
        ("charge: 101", "charge"),
        ("battery: {capacity_wh: -1}", "battery"),
        ("battery: {capacity_wh: 8, idle_w: 1, driving_w: 2, working_w: 3}", "charging_w"),
        (
            "battery: {capacity_wh: 8, idle_w: 1, driving_w: 2, working_w: 3, charging_w: 4, w: 1}",
            "robots\\[0\\].battery.w: there is no such field",
        ),
    ],
)
def test_batteries_that_cannot_be_are_refused(tmp_path: Path, more: str, said: str) -> None:
    path = tmp_path / "low.yaml"
    path.write_text(MISSION.format(more=more))
    with pytest.raises(BadFile, match=said):
        load_mission(path)


def test_a_charge_without_a_battery_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "low.yaml"
    path.write_text(MISSION.format(more="charge: 30").replace("hsr", "bench_arm"))
    with pytest.raises(BadFile, match="bench_arm has no `battery`"):
        load_mission(path)
