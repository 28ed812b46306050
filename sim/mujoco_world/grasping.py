"""Motions of the hand: grasping by friction and setting down.

The hand always points down and comes from above. Nothing holds an object but friction between the
finger pads, and success is what the hand's own sensors say.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

from keyexpr_schema.payloads.motions import PointM
from keyexpr_schema.payloads.robots import PoseMRad
from sim.mujoco_world.arm import Arm, Gripper
from sim.mujoco_world.base_controllers import PERIOD_S
from sim.mujoco_world.base_motions import distance_m
from sim.mujoco_world.motion import (
    MotionContext,
    MotionFailed,
    MotionRun,
    Step,
    Steps,
    check_way,
    drive_straight,
    face,
    move_arm,
    stow,
    wait,
)
from sim.mujoco_world.robot_body import RobotBody

HOVERS_M = (0.15, 0.12, 0.09, 0.06)
"""How far above its last position the hand comes in, the first that the arm can reach."""

RIM_M = 0.03
"""How far fingers pass above an edge."""

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

ROOM_M = 0.38
"""So far from where it reaches in under a roof a robot unfolds its arm."""

REACH_IN_M_S = 0.12


@dataclass(frozen=True)
class Reach:
    """Joint values above a point and at it."""

    above: list[float]
    at: list[float]


def grasp(context: MotionContext, run: MotionRun) -> Steps:
    """Close the hand on an object near a point, lift it and fold the arm."""
    name, point = run.motion.object, run.motion.point_m
    assert name is not None and point is not None
    robot = run.robot
    arm, gripper = hand_of(robot)
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
    grip_m = _grip_above_base(gripper, context.world.kind_of(name).extent_m[2])
    target = (point[0], point[1], point[2] + grip_m)
    hovers = _hovers_m(context, point, target[2], gripper.entry.finger_depth_m)
    path = reach_down(arm, target, context.observer.opening_rad(name), hovers)
    robot.grip_above_base_m = grip_m
    opening_m = gripper.entry.open_m
    if run.motion.robot is not None or context.observer.rim_m(point) is not None:
        opening_m = _grip_width_m(context, name) / 2 + BASKET_OPENING_M
    try:
        gripper.open(opening_m)
        yield from reach_over(context, run, point, path)
        yield from _take(run, path, name)
    except MotionFailed:
        robot.let_go()
        gripper.open()
        yield from stow(run)
        raise
    return ()


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
    arm, gripper = hand_of(robot)
    held = held_by(robot)
    yield from stow(run)
    _check_reach(run, point)
    run.handling = True
    yield from face(run, point[0], point[1])
    _check_free(context, robot, held, point, into)
    lift = robot.grip_above_base_m + RELEASE_LIFT_M + above_m
    target = (point[0], point[1], point[2] + lift)
    below = max(robot.grip_above_base_m, gripper.entry.finger_depth_m)
    path = reach_down(arm, target, None, _hovers_m(context, point, target[2], below))
    try:
        yield from reach_over(context, run, point, path, slower=1.5)
        # folded, the arm hid from the camera what is straight ahead
        _check_free(context, robot, held, point, into)
        yield from let_down(run, path, held, opening_m)
    except MotionFailed:
        yield from stow(run)
        raise


def reach_over(
    context: MotionContext, run: MotionRun, point: PointM, path: Reach, slower: float = 1.0
) -> Step:
    """Bring the hand above a point: from above or, under a roof, from the front.

    Raises:
        MotionFailed: something is in the way.
    """
    if any(fixture.roofs(point) for fixture in context.world.fixtures.by_name.values()):
        yield from reach_in(context, run, path, ROOM_M, slower)
    else:
        yield from move_arm(run, path.above, "moving the hand above the point", slower=slower)


def reach_in(
    context: MotionContext, run: MotionRun, path: Reach, back_m: float, slower: float = 1.0
) -> Step:
    """Unfold the arm `back_m` farther back, and drive up with it.

    An arm that unfolds reaches out farther, and lower, than where it comes to in the end.

    Raises:
        MotionFailed: something is in the way.
    """
    robot = run.robot
    if not robot.drives:
        raise MotionFailed(f"{robot.name} does not drive, as one must to reach in under a roof")
    start = robot.pose()
    back = behind(start, back_m)
    run.phase = "standing back"
    check_way(context, run, [start[:2], back[:2]])
    run.phase = "waiting for room to stand back"
    while not context.navigator.reserve(robot.name, [back[:2], start[:2]]):
        yield
    yield from drive_straight(run, back, "standing back")
    robot.way_out = back
    yield from move_arm(run, path.above, "reaching out", slower=slower)
    yield from drive_straight(run, start, "reaching in", REACH_IN_M_S)


def behind(pose: PoseMRad, back_m: float) -> PoseMRad:
    """The pose so far behind another one."""
    x, y, yaw = pose
    return (x - back_m * math.cos(yaw), y - back_m * math.sin(yaw), yaw)


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


def _grip_above_base(gripper: Gripper, height_m: float) -> float:
    lowest = gripper.entry.finger_depth_m + CLEARANCE_M
    return max(lowest, GRIP_SHARE * height_m, height_m - PALM_ROOM_M)


def _hovers_m(
    context: MotionContext, point: PointM, grip_z_m: float, below_m: float
) -> tuple[float, ...]:
    """How far above its last position the hand comes in.

    In a drawer or basin, so that fingers and load, which reach `below_m` below the grip, are clear
    of the edge.
    """
    rim_m = context.observer.rim_m(point)
    if rim_m is None:
        return HOVERS_M
    return (max(rim_m + RIM_M + below_m - grip_z_m, HOVERS_M[-1]),)


def reach_down(
    arm: Arm,
    target: PointM,
    opening_rad: float | None,
    hovers_m: tuple[float, ...] = HOVERS_M,
) -> Reach:
    """Joint values for a target and above it, clear of obstacles as is the way between them.

    The first seed that works.

    Raises:
        MotionFailed: there are none.
    """
    x, y, z = target
    touched = None
    for seed in arm.entry.seeds:
        at = arm.solve(target, seed, opening_rad)
        if at is None:
            continue
        hit = arm.obstacle(at)
        if hit is not None:
            touched = hit
            continue
        for hover, start in itertools.product(hovers_m, (at, *arm.entry.seeds)):
            above = arm.solve((x, y, z + hover), start, opening_rad)
            if above is not None:
                hit = arm.obstacle_between(above, at)
                if hit is None:
                    return Reach(above=above, at=at)
                touched = hit
    if touched is not None:
        raise MotionFailed(
            f"the arm would touch {touched}: approach the point from another side", touched
        )
    raise MotionFailed(
        f"the hand cannot get to ({x:.2f}, {y:.2f}, {z:.2f}) from where the robot stands"
    )


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
