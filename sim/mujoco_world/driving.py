"""Motions without the hand: driving somewhere, looking around, folding the arm."""

from __future__ import annotations

import math
from collections.abc import Callable

from keyexpr_schema.payloads.motions import Detection, Motion, PointM
from sim.errors import NoPath, NoStance
from sim.mujoco_world.drives import wrap
from sim.mujoco_world.stage import Act, CannotDo, Ending, Stage, Step, Steps, stow

LOOK_RATE_RAD_S = 1.0
REACH_MARGIN_M = 0.015
"""The base stops within this of where it was to stand."""

BESIDE_M = (0.15, 0.6)
"""How far from its own rim a robot without a hand stops before a point."""

BESIDE_ROBOT_M = (0.60, 0.95)
"""How far from a point on another robot it stops: outside of the room that traffic gives that."""


def go_to(stage: Stage, act: Act, motion: Motion) -> Steps:
    """Drive to a free spot inside a place."""
    place = motion.place
    assert place is not None
    yield from stow(act)
    act.phase = f"driving to {place}"
    yield from _navigate(stage, act, lambda: stage.navigator.go_to_place(act.robot.name, place))
    x, y, _ = act.robot.pose()
    if stage.world.place_at(x, y) != place:
        raise CannotDo(f"it stopped at ({x:.2f}, {y:.2f}), which is not in {place}")
    return Ending()


def approach(stage: Stage, act: Act, motion: Motion) -> Steps:
    """Drive to where the hand reaches a point."""
    point = motion.point_m
    assert point is not None
    yield from stow(act)
    act.phase = "driving up to the point"
    host = _robot_at(stage, act, point)
    if host is not None:
        # It must not make way now; and it needs its room, so the last bit is driven by the motion
        # that reaches into its basket.
        act.guest_of = host
        yield
    reach = reach_m(act) if host is None else BESIDE_ROBOT_M
    yield from _navigate(stage, act, lambda: stage.navigator.approach(act.robot.name, point, reach))
    return Ending()


def _robot_at(stage: Stage, act: Act, point: PointM) -> str | None:
    """The other robot on whose footprint a point lies."""
    for name, other in stage.robots.items():
        near = math.dist(other.pose()[:2], point[:2]) < other.description.radius_m
        if near and name != act.robot.name:
            return name
    return None


def reach_m(act: Act) -> tuple[float, float]:
    """How far from a point a robot may stand to reach it, (least, greatest), m."""
    about = act.robot.description
    if about.arm is None:
        return (about.radius_m + BESIDE_M[0], about.radius_m + BESIDE_M[1])
    least, greatest = about.arm.reach_m
    return (least + REACH_MARGIN_M, greatest - REACH_MARGIN_M)


def look(stage: Stage, act: Act, motion: Motion) -> Steps:
    """Turn once round on the spot and report every object that the camera gets to see."""
    robot = act.robot
    if robot.camera < 0:
        raise CannotDo(f"{robot.name} has no camera")
    yield from stow(act)
    act.phase = "looking around"
    act.manual = True
    robot.drive.halt()
    seen: dict[str, Detection] = {}
    last = robot.pose()[2]
    turned = 0.0
    robot.drive.spin(LOOK_RATE_RAD_S)
    while turned < math.tau:
        for name in stage.world.object_entries:
            if name not in seen and robot.held != name and stage.observer.sees(robot, name):
                seen[name] = stage.observer.detect(robot, name)
        yield
        yaw = robot.pose()[2]
        turned += wrap(yaw - last)
        last = yaw
    robot.drive.halt()
    while robot.moving():
        yield
    return Ending(tuple(seen[name] for name in stage.world.object_entries if name in seen))


def fold(stage: Stage, act: Act, motion: Motion) -> Steps:
    """Fold the arm into its carrying pose."""
    if act.robot.arm is None:
        raise CannotDo(f"{act.robot.name} has no arm to fold")
    act.handling = True
    yield from stow(act)
    return Ending()


def _navigate(stage: Stage, act: Act, ask: Callable[[], None]) -> Step:
    """Have the navigator bring the robot somewhere, and wait until it stands there."""
    try:
        ask()
    except (NoStance, NoPath) as error:
        raise CannotDo(str(error)) from None
    yield
    while True:
        leg = stage.legs.get(act.robot.name)
        if leg is not None and leg.failed is not None:
            raise CannotDo(leg.failed)
        if leg is not None and leg.arrived and not act.robot.moving():
            return
        yield


def distance_m(act: Act, point_m: PointM) -> float:
    """From the base's axis to a point, along the floor."""
    return math.dist(act.robot.pose()[:2], point_m[:2])
