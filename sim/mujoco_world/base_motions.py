"""Motions without the hand: driving somewhere, looking around, folding the arm."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from keyexpr_schema.payloads.motions import Detection, PointM
from keyexpr_schema.payloads.robots import PoseMRad
from sim.errors import NoStance, NoWay
from sim.mujoco_world.base_controllers import wrap
from sim.mujoco_world.motion import MotionContext, MotionFailed, MotionRun, Step, Steps, stow
from sim.mujoco_world.robot_body import RobotBody

LOOK_RATE_RAD_S = 1.0
REACH_MARGIN_M = 0.015
"""The base stops within this of where it was to stand."""

STRETCHED_M = 0.03
"""An arm within this of its reach is stretched out."""

BESIDE_M = (0.15, 0.6)
"""How far from its own rim a robot without a hand stops before a point."""


def go_to(context: MotionContext, run: MotionRun) -> Steps:
    """Drive to a free spot inside a place."""
    place = run.motion.place
    assert place is not None
    yield from stow(run)
    run.phase = f"driving to {place}"
    host = _works_in(context, run, place)
    if host is not None:
        # Who comes to an arm that does not drive stops where its hand gets to.
        x, y, _ = host.pose()
        assert host.description.arm is not None
        least, greatest = host.description.arm.reach_m
        near = (least + REACH_MARGIN_M, greatest - REACH_MARGIN_M)
        yield from stand_at(context, run, (x, y, 0.0), near)
    elif run.robot.drives:
        ask = context.navigator.go_to_place
        yield from navigate(context, run, lambda: ask(run.robot.name, place))
    x, y, _ = run.robot.pose()
    if place not in context.world.places_around(context.world.place_at(x, y)):
        raise MotionFailed(f"it stopped at ({x:.2f}, {y:.2f}), which is not in {place}")
    return ()


def _works_in(context: MotionContext, run: MotionRun, place: str) -> RobotBody | None:
    """Another robot, with an arm, that does not drive and stands in a place."""
    for other in context.robots.values():
        if other.drives or other.arm is None or other is run.robot:
            continue
        x, y, _ = other.pose()
        if context.world.place_at(x, y) == place:
            return other
    return None


def stand_at(
    context: MotionContext,
    run: MotionRun,
    point: PointM,
    reach: tuple[float, float],
    heading_rad: float | None = None,
    in_vain: Sequence[tuple[float, float]] = (),
    fits: Callable[[PoseMRad], bool] | None = None,
) -> Step:
    """Drive to where `point` is in reach, as `Navigator.approach` says.

    Raises:
        MotionFailed: there is no way there, or it is out of reach of who does not drive.
    """
    robot = run.robot
    if robot.drives:
        ask = context.navigator.approach
        yield from navigate(
            context, run, lambda: ask(robot.name, point, reach, heading_rad, in_vain, fits)
        )
    elif not in_reach(run, point, reach):
        raise MotionFailed(
            f"{robot.name} does not drive, and ({point[0]:.2f}, {point[1]:.2f}) is "
            f"{distance_m(run, point):.2f} m away: it reaches from {reach[0]:.2f} to "
            f"{reach[1]:.2f} m",
            retryable=False,
        )


def in_reach(run: MotionRun, point: PointM, reach: tuple[float, float]) -> bool:
    """Whether a point is so far away, `REACH_MARGIN_M` more or less."""
    return reach[0] - REACH_MARGIN_M <= distance_m(run, point) <= reach[1] + REACH_MARGIN_M


def reach_m(run: MotionRun) -> tuple[float, float]:
    """How far from a point a robot may stand to reach it, (least, greatest), m."""
    about = run.robot.description
    if about.arm is None:
        return (about.radius_m + BESIDE_M[0], about.radius_m + BESIDE_M[1])
    least, greatest = about.arm.reach_m
    return (least + REACH_MARGIN_M, greatest - REACH_MARGIN_M)


def reach_to_m(context: MotionContext, run: MotionRun, point: PointM) -> tuple[float, float]:
    """How far from a point to stand: over an edge, or under a roof, with the arm stretched out.

    A stretched arm is level; one that bends has its elbow, or its shoulder, in the way.
    """
    least, greatest = reach_m(run)
    if run.robot.arm is not None and (
        context.observer.rim_m(point) is not None
        or context.world.fixtures.roof_over(point) is not None
    ):
        least = greatest - STRETCHED_M
    return (least, greatest)


def look(context: MotionContext, run: MotionRun) -> Steps:
    """Turn once round on the spot and report every object that the camera gets to see."""
    robot = run.robot
    if robot.camera < 0:
        raise MotionFailed(f"{robot.name} has no camera")
    yield from stow(run)
    run.phase = "looking around"
    run.manual = True
    robot.drive.halt()
    seen: dict[str, Detection] = {}
    last = robot.pose()[2]
    turned = 0.0
    robot.drive.spin(LOOK_RATE_RAD_S)
    while turned < math.tau:
        for name in context.observer.in_view(robot):
            if name not in seen and robot.held != name and context.observer.sees(robot, name):
                seen[name] = context.observer.detect(robot, name)
        for name in context.observer.noticed:
            if name not in seen and context.observer.notices(robot, name):
                seen[name] = context.observer.detect_fixture(name)
        yield
        yaw = robot.pose()[2]
        turned += wrap(yaw - last)
        last = yaw
    robot.drive.halt()
    while robot.moving():
        yield
    order = (*context.world.object_entries, *context.observer.noticed)
    return tuple(seen[name] for name in order if name in seen)


def fold(context: MotionContext, run: MotionRun) -> Steps:
    """Fold the arm into its carrying pose."""
    if run.robot.arm is None:
        raise MotionFailed(f"{run.robot.name} has no arm to fold")
    run.handling = True
    yield from stow(run)
    return ()


def navigate(context: MotionContext, run: MotionRun, ask: Callable[[], None]) -> Step:
    """Have the navigator bring the robot somewhere, and wait until it stands there."""
    try:
        ask()
    except NoWay as error:
        hopeless = isinstance(error, NoStance) and error.blocked_by is None
        raise MotionFailed(str(error), error.blocked_by, not hopeless) from None
    yield
    while True:
        leg = context.legs.get(run.robot.name)
        if leg is not None and leg.failed is not None:
            raise MotionFailed(leg.failed)
        if leg is not None and leg.arrived and not run.robot.moving():
            return
        yield


def distance_m(run: MotionRun, point_m: PointM) -> float:
    """From the base's axis to a point, along the floor."""
    return math.dist(run.robot.pose()[:2], point_m[:2])
