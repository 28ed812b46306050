"""Motions of the hand: grasping by friction, setting down, letting down into a basket.

The hand always points down and comes from above. Nothing holds an object but friction between the
finger pads, and success is what the hand's own sensors say.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass

from keyexpr_schema.motions import Motion, PointM
from keyexpr_schema.robots import PoseMRad
from sim.mujoco_world.arm import Arm, Gripper
from sim.mujoco_world.drives import PERIOD_S, wrap
from sim.mujoco_world.driving import distance_m
from sim.mujoco_world.robot_body import RobotBody
from sim.mujoco_world.stage import (
    Act,
    CannotDo,
    Ending,
    Stage,
    Step,
    Steps,
    face,
    move_arm,
    stow,
    wait,
)
from sim.world_model import Solid

HOVERS_M = (0.15, 0.12, 0.09, 0.06)
"""How far above its last position the hand comes in, the first that the arm can reach."""

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
BASKET_OPENING_M = 0.012
"""In a basket the fingers open only this much, so as not to push against its walls."""

CLOSE_IN_M = 1.15
CLOSE_IN_M_S = 0.25
APART_M = 0.03
"""Between two robots' footprints when one reaches into the other's basket."""

CLEARANCE_M = 0.005
SLOT_GAP_M = 0.06
"""Room for the fingers between two objects in a basket."""


@dataclass(frozen=True)
class _Reach:
    """Joint values above a point and at it."""

    above: list[float]
    at: list[float]


def grasp(stage: Stage, act: Act, motion: Motion) -> Steps:
    """Close the hand on an object near a point, lift it and fold the arm."""
    name, point = motion.object, motion.point_m
    assert name is not None and point is not None
    robot = act.robot
    arm, gripper = _hand(robot)
    if robot.held is not None:
        raise CannotDo(f"the hand is not empty: it holds {robot.held}")
    payload = robot.spec.capabilities.get("grip", 0.0)
    entry = stage.world.object_entries[name]
    mass = stage.world.object_kinds[entry.kind].mass_kg
    if mass > payload:
        raise CannotDo(f"{name} weighs {mass:.2f} kg; the hand carries {payload:.2f} kg")
    yield from stow(act)
    _check_reach(act, point)
    act.handling = True
    yield from face(act, point[0], point[1])
    point = _refined(stage, robot, name, point)
    yield from face(act, point[0], point[1])
    grip_m = _grip_above_base(gripper, stage.observer.height_m(name))
    target = (point[0], point[1], point[2] + grip_m)
    path = _reach(arm, target, stage.observer.opening_rad(name))
    gripper.open()
    yield from move_arm(act, path.above, "moving the hand above the object")
    yield from move_arm(act, path.at, "lowering the hand", slower=1.5)
    yield from _close(act, gripper, name)
    robot.held, robot.grip_above_base_m = name, grip_m
    yield from move_arm(act, path.above, f"lifting {name}", slower=2.0)
    yield from wait(SETTLE_S)
    if robot.held is None or not gripper.feels():
        robot.held = None
        gripper.open()
        yield from stow(act)
        raise CannotDo(f"{name} slipped out of the hand while it was lifted")
    yield from stow(act)
    if robot.held is None:
        raise CannotDo(f"{name} slipped out of the hand while the arm was folded")
    return Ending()


def release(stage: Stage, act: Act, motion: Motion) -> Steps:
    """Set the held object down so that its base touches a point."""
    point = motion.point_m
    assert point is not None
    robot = act.robot
    arm, _ = _hand(robot)
    held = _held(robot)
    yield from stow(act)
    _check_reach(act, point)
    act.handling = True
    yield from face(act, point[0], point[1])
    _check_free(stage, robot, held, point)
    target = (point[0], point[1], point[2] + robot.grip_above_base_m + RELEASE_LIFT_M)
    yield from _let_down(act, _reach(arm, target, None), held, RELEASE_OPENING_M)
    return Ending()


def release_in_basket(stage: Stage, act: Act, motion: Motion) -> Steps:
    """Let the held object down into a free spot of another robot's basket."""
    assert motion.robot is not None
    robot, other = act.robot, stage.robots[motion.robot]
    _hand(robot)
    held = _held(robot)
    if other.basket < 0:
        raise CannotDo(f"{other.name} has no basket")
    lying = stage.observer.basket(other)
    room = int(other.spec.capabilities.get("basket", 0))
    if len(lying) >= room:
        raise CannotDo(f"the basket of {other.name} is full: it holds {', '.join(lying)}")
    act.guest_of = other.name
    act.handling = True
    yield from stow(act)
    act.phase = f"waiting for {other.name} to stand still"
    while other.moving():
        yield
    spots = _free_spots(stage, other, held) if motion.point_m is None else [motion.point_m]
    if not spots:
        raise CannotDo(f"there is no free spot in the basket of {other.name}")
    start = robot.pose()
    try:
        path = yield from _above_a_spot(stage, act, spots, other)
        yield from _let_down(act, path, held, BASKET_OPENING_M)
    except CannotDo:
        yield from stow(act)
        yield from _drive_straight(act, start, "backing off")
        raise
    yield from _drive_straight(act, start, "backing off")
    return Ending()


def _above_a_spot(
    stage: Stage, act: Act, spots: list[PointM], other: RobotBody
) -> Generator[None, None, _Reach]:
    """Stand before the nearest spot that the hand can get to; how it gets there.

    Raises:
        CannotDo: why the last one cannot be reached.
    """
    robot = act.robot
    arm, _ = _hand(robot)
    failure = CannotDo("")
    for spot in sorted(spots, key=lambda spot: distance_m(act, spot)):
        try:
            yield from face(act, spot[0], spot[1])
            yield from _close_in(stage, act, spot, other)
            target = (spot[0], spot[1], spot[2] + robot.grip_above_base_m + RELEASE_LIFT_M)
            return _reach(arm, target, None)
        except CannotDo as error:
            failure = error
    raise failure


def _close_in(stage: Stage, act: Act, spot: PointM, other: RobotBody) -> Step:
    """Drive straight on until a spot in another robot's basket is within reach.

    Raises:
        CannotDo: it is too far, or something stands between.
    """
    robot = act.robot
    assert robot.arm is not None
    least, greatest = robot.arm.entry.reach_m
    distance = distance_m(act, spot)
    if distance <= greatest:
        return
    if distance > CLOSE_IN_M:
        raise CannotDo(
            f"the basket of {other.name} is {distance:.2f} m away; this is done from at most "
            f"{CLOSE_IN_M:.2f} m: approach it first"
        )
    x, y, _ = robot.pose()
    heading = math.atan2(spot[1] - y, spot[0] - x)
    way = distance - (least + 2 * greatest) / 3
    goal = (x + way * math.cos(heading), y + way * math.sin(heading), heading)
    # two round footprints must stay apart, whichever part of the basket is aimed at
    apart = robot.description.radius_m + other.description.radius_m + APART_M
    if math.dist(goal[:2], other.pose()[:2]) < apart:
        raise CannotDo(f"to reach that spot it would run into {other.name}")
    blocker = _in_the_way(stage, act, other, (x, y), goal[:2])
    if blocker is not None:
        raise CannotDo(f"{blocker} is in the way to the basket of {other.name}")
    yield from _drive_straight(act, goal, f"driving up to {other.name}")


def _in_the_way(
    stage: Stage, act: Act, host: RobotBody, start: tuple[float, float], goal: tuple[float, float]
) -> str | None:
    """What a straight drive would run into, walls and furniture as well as robots."""
    robot = act.robot
    room = robot.description.clearance_m
    for step in range(11):
        share = step / 10
        x, y = (a + share * (b - a) for a, b in zip(start, goal, strict=True))
        for solid in stage.world.solids():
            if _distance_m(solid, x, y) < room:
                return solid.name
        for other in stage.robots.values():
            if other in (robot, host):
                continue
            if math.dist(other.pose()[:2], (x, y)) < room + other.description.clearance_m:
                return other.name
    return None


def _distance_m(solid: Solid, x_m: float, y_m: float) -> float:
    """From a point to an upright box; 0 inside."""
    c, s = math.cos(solid.yaw_rad), math.sin(solid.yaw_rad)
    dx, dy = x_m - solid.center_m[0], y_m - solid.center_m[1]
    along = max(abs(c * dx + s * dy) - solid.half_m[0], 0.0)
    across = max(abs(c * dy - s * dx) - solid.half_m[1], 0.0)
    return math.hypot(along, across)


def _drive_straight(act: Act, goal: PoseMRad, phase: str) -> Step:
    """Move the base by hand, slowly, to a pose close by."""
    act.phase = phase
    drive = act.robot.drive
    drive.drive(*goal, CLOSE_IN_M_S)
    while True:
        yield
        x, y, yaw = act.robot.pose()
        near = math.dist((x, y), goal[:2]) < 0.02 and abs(wrap(yaw - goal[2])) < 0.02
        if near and not act.robot.moving():
            return


def _let_down(act: Act, path: _Reach, held: str, opening_m: float) -> Step:
    """Lower what is held, open the hand, withdraw it and make sure that it is empty."""
    robot = act.robot
    _, gripper = _hand(robot)
    yield from move_arm(act, path.above, "moving the hand above the point", slower=1.5)
    yield from move_arm(act, path.at, "lowering the hand", slower=2.5)
    yield from wait(0.3)
    if robot.held is None:
        raise CannotDo(f"{held} was lost on the way down")
    act.phase = "opening the hand"
    gripper.open(gripper.opening_m() + opening_m)
    yield from wait(0.6)
    if gripper.feels():
        raise CannotDo(f"the hand is open and {held} still sticks to it")
    robot.held = None
    yield from move_arm(act, path.above, "withdrawing the hand", slower=1.5)
    yield from stow(act)


def _hand(robot: RobotBody) -> tuple[Arm, Gripper]:
    if robot.arm is None or robot.gripper is None:
        raise CannotDo(f"{robot.name} has no hand")
    return robot.arm, robot.gripper


def _held(robot: RobotBody) -> str:
    if robot.held is None:
        raise CannotDo("the hand is empty")
    return robot.held


def _check_reach(act: Act, point_m: PointM) -> None:
    arm = act.robot.arm
    assert arm is not None
    distance = distance_m(act, point_m)
    least, greatest = arm.entry.reach_m
    if not least - 0.02 <= distance <= greatest + 0.01:
        raise CannotDo(
            f"the point is {distance:.2f} m away and the hand reaches from {least:.2f} to "
            f"{greatest:.2f} m: approach it first"
        )


def _refined(stage: Stage, robot: RobotBody, name: str, point: PointM) -> PointM:
    """Where the camera sees the object now; where it was said to be if it does not see it.

    Raises:
        CannotDo: it is seen somewhere else.
    """
    if not stage.observer.sees(robot, name):
        return point
    seen = stage.observer.detect(robot, name).point_m
    if math.dist(seen, point) > PERCEIVED_NEAR_M:
        raise CannotDo(
            f"{name} is not there: it is seen at ({seen[0]:.2f}, {seen[1]:.2f}, {seen[2]:.2f}), "
            f"{math.dist(seen, point):.2f} m away from the point"
        )
    return seen


def _grip_above_base(gripper: Gripper, height_m: float) -> float:
    lowest = gripper.entry.finger_depth_m + CLEARANCE_M
    return max(lowest, GRIP_SHARE * height_m, height_m - PALM_ROOM_M)


def _reach(arm: Arm, target: PointM, opening_rad: float | None) -> _Reach:
    """Joint values for a target and above it, clear of obstacles: the first seed that works.

    Raises:
        CannotDo: there are none.
    """
    x, y, z = target
    touched = None
    for seed in arm.entry.seeds:
        at = arm.solve(target, seed, opening_rad)
        if at is None:
            continue
        for hover in HOVERS_M:
            above = arm.solve((x, y, z + hover), at, opening_rad)
            if above is not None:
                touched = arm.obstacle(at) or arm.obstacle(above)
                if touched is None:
                    return _Reach(above=above, at=at)
                break
    if touched is not None:
        raise CannotDo(f"the arm would touch {touched}: approach the point from another side")
    raise CannotDo(
        f"the hand cannot get to ({x:.2f}, {y:.2f}, {z:.2f}) from where the robot stands"
    )


def _close(act: Act, gripper: Gripper, name: str) -> Step:
    """Close the hand until both fingers press on something.

    Raises:
        CannotDo: they met, or only one of them found something.
    """
    act.phase = f"closing the hand on {name}"
    gripper.close()
    waited = 0.0
    felt = 0.0
    while felt < SETTLE_S:
        yield
        waited += PERIOD_S
        felt = felt + PERIOD_S if gripper.feels() else 0.0
        if waited > CLOSE_TIMEOUT_S:
            gripper.open()
            yield from stow(act)
            raise CannotDo(f"the hand closed on nothing: {name} is not between the fingers")


def _check_free(stage: Stage, robot: RobotBody, held: str, point: PointM) -> None:
    """Raises `CannotDo` where the camera sees something standing on the point."""
    for name in stage.world.object_entries:
        if name == held or not stage.observer.sees(robot, name):
            continue
        seen = stage.observer.detect(robot, name).point_m
        room = (_width_m(stage, name) + _width_m(stage, held)) / 2 + 0.03
        if math.dist(seen, point) < room:
            raise CannotDo(
                f"{name} stands where {held} was to be set down; keep {room:.2f} m from it"
            )


def _width_m(stage: Stage, name: str) -> float:
    entry = stage.world.object_entries[name]
    return max(stage.world.object_kinds[entry.kind].extent_m[:2])


def _free_spots(stage: Stage, other: RobotBody, held: str) -> list[PointM]:
    """Points on a basket's floor where the held object has room, world frame."""
    half_x, half_y, _ = other.basket_half_m
    pitch = _width_m(stage, held) + SLOT_GAP_M
    across, along = (max(1, int(2 * half / pitch)) for half in (half_x, half_y))
    taken = [
        (stage.observer.base_point(name), _width_m(stage, name))
        for name in stage.observer.basket(other)
    ]
    spots = []
    for column in range(across):
        for row in range(along):
            spot = other.basket_point(
                half_x * (2 * column + 1 - across) / across, half_y * (2 * row + 1 - along) / along
            )
            if all(
                math.dist(spot[:2], at[:2]) > (width + _width_m(stage, held)) / 2
                for at, width in taken
            ):
                spots.append(spot)
    return spots
