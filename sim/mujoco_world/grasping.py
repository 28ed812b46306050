"""Motions of the hand: grasping by friction and setting down.

The hand always points down and comes from above. Nothing holds an object but friction between the
finger pads, and success is what the hand's own sensors say.
"""

from __future__ import annotations

import math
from dataclasses import replace

from keyexpr_schema.payloads.motions import PointM
from sim.mujoco_world.arm import Arm, Gripper
from sim.mujoco_world.base_controllers import PERIOD_S
from sim.mujoco_world.base_motions import distance_m
from sim.mujoco_world.motion import (
    MotionContext,
    MotionFailed,
    MotionRun,
    Step,
    Steps,
    face,
    move_arm,
    stow,
    wait,
)
from sim.mujoco_world.reaching import Reach, hovers_m, reach_down, reach_over
from sim.mujoco_world.robot_body import RobotBody

GRIP_SHARE = 0.6
"""Where an object is taken, as a share of its height: above its middle, so that it hangs."""

PALM_ROOM_M = 0.085
"""An object may stand out this far above the grip before it meets the palm."""

PERCEIVED_NEAR_M = 0.15
"""An object seen farther than this from where it was said to be is another one, or has moved."""

CLOSE_TIMEOUT_S = 3.0
SETTLE_S = 0.4
RELEASE_LIFT_M = 0.004
"""An object is let go this far above the surface at most; it drops the rest."""

RELEASE_OPENING_M = 0.025
CLEARANCE_M = 0.005

BASKET_OPENING_M = 0.012
"""In a basket or drawer the fingers open only this much, so as not to push against its walls."""


def grasp(context: MotionContext, run: MotionRun) -> Steps:
    """Close the hand on an object near a point, lift it and fold the arm."""
    name, point = run.motion.object, run.motion.point_m
    assert name is not None and point is not None
    robot = run.robot
    _, gripper = hand_of(robot)
    if robot.held is not None:
        raise MotionFailed(f"the hand is not empty: it holds {robot.held}")
    payload = robot.spec.capabilities.get("grip", 0.0)
    mass = context.world.kind_of(name).mass_kg
    if mass > payload:
        raise MotionFailed(f"{name} weighs {mass:.2f} kg; the hand carries {payload:.2f} kg")
    yield from stow(run)
    _check_reach(run, point)
    run.handling = True
    yield from face(run, point[0], point[1])
    point = _refined(context, robot, name, point)
    yield from face(run, point[0], point[1])
    path = path_to_grip(context, robot, name, point, run.motion.robot is not None)
    robot.grip_above_base_m = _grip_above_base(context, gripper, name)
    try:
        gripper.open(path.opening_m)
        yield from reach_over(context, run, point, path)
        yield from _take(run, path, name)
    except MotionFailed:
        robot.let_go()
        gripper.open()
        yield from stow(run)
        raise
    return ()


def path_to_grip(
    context: MotionContext, robot: RobotBody, name: str, point: PointM, in_basket: bool = False
) -> Reach:
    """How the hand gets around an object whose base is at a point.

    Raises:
        MotionFailed: it does not.
    """
    arm, gripper = hand_of(robot)
    x, y, z = point
    target = (x, y, z + _grip_above_base(context, gripper, name))
    hovers = hovers_m(context, point, target[2], gripper.entry.finger_depth_m)
    opening_m = gripper.entry.open_m
    if in_basket or context.observer.rim_m(point) is not None:
        opening_m = min(opening_m, _grip_width_m(context, name) / 2 + BASKET_OPENING_M)
    with robot.imagined(opening_m=opening_m):
        path = reach_down(arm, target, context.observer.opening_rad(name), hovers)
    return replace(path, opening_m=opening_m)


def path_to_set_down(
    context: MotionContext, robot: RobotBody, point: PointM, above_m: float = 0.0
) -> Reach:
    """How the hand gets to where it lets go of what it holds, `above_m` above a point.

    Raises:
        MotionFailed: it does not.
    """
    arm, gripper = hand_of(robot)
    x, y, z = point
    target = (x, y, z + robot.grip_above_base_m + RELEASE_LIFT_M + above_m)
    below = max(robot.grip_above_base_m, gripper.entry.finger_depth_m)
    return reach_down(arm, target, None, hovers_m(context, point, target[2], below))


def _take(run: MotionRun, path: Reach, name: str) -> Step:
    """Come down around the object, close on it, lift it.

    Raises:
        MotionFailed: it is not in the hand in the end.
    """
    robot = run.robot
    _, gripper = hand_of(robot)
    yield from move_arm(run, path.at, "lowering the hand", slower=1.5)
    robot.reaching_for = name
    yield from close_on(run, gripper, name)
    yield from move_arm(run, path.above, f"lifting {name}", slower=2.0)
    yield from wait(SETTLE_S)
    if not (robot.held == name and gripper.feels()):
        raise MotionFailed(f"{name} slipped out of the hand while it was lifted")
    yield from stow(run)
    if robot.held != name:
        raise MotionFailed(f"{name} slipped out of the hand while the arm was folded")


def release(context: MotionContext, run: MotionRun) -> Steps:
    """Set the held object down so that its base touches a point."""
    point = run.motion.point_m
    assert point is not None
    yield from set_down(context, run, point)
    return ()


def set_down(
    context: MotionContext,
    run: MotionRun,
    point: PointM,
    *,
    into: str | None = None,
    above_m: float = 0.0,
    opening_m: float = RELEASE_OPENING_M,
) -> Step:
    """Set the held object down at a point: on or in the thing `into`, if that is given, and let go
    `above_m` above it.

    Raises:
        MotionFailed: it is out of reach, something stands there, or the object is still in the hand
            or lost.
    """
    robot = run.robot
    held = held_by(robot)
    yield from stow(run)
    _check_reach(run, point)
    run.handling = True
    yield from face(run, point[0], point[1])
    _check_free(context, robot, held, point, into)
    path = path_to_set_down(context, robot, point, above_m)
    try:
        yield from reach_over(context, run, point, path, slower=1.5)
        # folded, the arm hid from the camera what is straight ahead
        _check_free(context, robot, held, point, into)
        yield from let_down(run, path, held, opening_m)
    except MotionFailed:
        yield from stow(run)
        raise


def let_down(run: MotionRun, path: Reach, held: str, opening_m: float) -> Step:
    """Lower what is held, open the hand, withdraw it and make sure that it is empty."""
    robot = run.robot
    _, gripper = hand_of(robot)
    yield from move_arm(run, path.above, "moving the hand above the point", slower=1.5)
    yield from move_arm(run, path.at, "lowering the hand", slower=2.5)
    yield from wait(0.3)
    if robot.held is None:
        raise MotionFailed(f"{held} was lost on the way down")
    run.phase = "opening the hand"
    robot.let_go()
    gripper.open(gripper.opening_m() + opening_m)
    yield from wait(0.6)
    if gripper.feels():
        robot.reaching_for = held
        raise MotionFailed(f"the hand is open and {held} still sticks to it")
    yield from move_arm(run, path.above, "withdrawing the hand", slower=1.5)
    yield from stow(run)


def hand_of(robot: RobotBody) -> tuple[Arm, Gripper]:
    """The robot's arm and gripper.

    Raises:
        MotionFailed: it has none.
    """
    if robot.arm is None or robot.gripper is None:
        raise MotionFailed(f"{robot.name} has no hand")
    return robot.arm, robot.gripper


def held_by(robot: RobotBody) -> str:
    """The object in the robot's hand.

    Raises:
        MotionFailed: the hand is empty.
    """
    if robot.held is None:
        raise MotionFailed("the hand is empty")
    return robot.held


def _check_reach(run: MotionRun, point_m: PointM) -> None:
    arm = run.robot.arm
    assert arm is not None
    distance = distance_m(run, point_m)
    least, greatest = arm.entry.reach_m
    if not least - 0.02 <= distance <= greatest + 0.01:
        raise MotionFailed(
            f"the point is {distance:.2f} m away and the hand reaches from {least:.2f} to "
            f"{greatest:.2f} m: approach it first"
        )


def _refined(context: MotionContext, robot: RobotBody, name: str, point: PointM) -> PointM:
    """Where the camera sees the object now; where it was said to be if it does not see it.

    Raises:
        MotionFailed: it is seen somewhere else.
    """
    if not context.observer.sees(robot, name):
        return point
    seen = context.observer.detect(robot, name).point_m
    if math.dist(seen, point) > PERCEIVED_NEAR_M:
        raise MotionFailed(
            f"{name} is not there: it is seen at ({seen[0]:.2f}, {seen[1]:.2f}, {seen[2]:.2f}), "
            f"{math.dist(seen, point):.2f} m away from the point"
        )
    return seen


def _grip_above_base(context: MotionContext, gripper: Gripper, name: str) -> float:
    height_m = context.world.kind_of(name).extent_m[2]
    lowest = gripper.entry.finger_depth_m + CLEARANCE_M
    return max(lowest, GRIP_SHARE * height_m, height_m - PALM_ROOM_M)


def close_on(run: MotionRun, gripper: Gripper, name: str) -> Step:
    """Close the hand until both fingers press on something.

    Raises:
        MotionFailed: they met, or only one of them found something.
    """
    run.phase = f"closing the hand on {name}"
    gripper.close()
    waited = 0.0
    felt = 0.0
    while felt < SETTLE_S:
        yield
        waited += PERIOD_S
        felt = felt + PERIOD_S if gripper.feels() else 0.0
        if waited > CLOSE_TIMEOUT_S:
            raise MotionFailed(f"the hand closed on nothing: {name} is not between the fingers")


def _check_free(
    context: MotionContext, robot: RobotBody, held: str, point: PointM, into: str | None
) -> None:
    """Raises `MotionFailed` where the camera sees something standing on the point."""
    for name in context.world.object_entries:
        if name in (held, into) or not context.observer.sees(robot, name):
            continue
        detection = context.observer.detect(robot, name)
        if detection.support == held:
            continue  # it goes where the held one goes
        seen = detection.point_m
        room = (width_m(context, name) + width_m(context, held)) / 2 + 0.03
        if math.dist(seen, point) < room:
            raise MotionFailed(
                f"{name} stands where {held} was to be set down; keep {room:.2f} m from it"
            )


def _grip_width_m(context: MotionContext, name: str) -> float:
    """The smaller horizontal extent of an object [m], across which the hand takes it."""
    return min(context.world.kind_of(name).extent_m[:2])


def width_m(context: MotionContext, name: str) -> float:
    """The larger horizontal extent of an object [m]."""
    return max(context.world.kind_of(name).extent_m[:2])
