"""Handing over: letting what the hand holds down into another robot's basket."""

from __future__ import annotations

import math
from collections.abc import Generator

from keyexpr_schema.payloads.motions import Motion, PointM
from keyexpr_schema.payloads.robots import PoseMRad
from sim.files.solids import Solid, solids
from sim.mujoco_world.drives import wrap
from sim.mujoco_world.driving import distance_m
from sim.mujoco_world.handling import (
    RELEASE_LIFT_M,
    Reach,
    hand_of,
    held_by,
    let_down,
    reach_down,
    width_m,
)
from sim.mujoco_world.robot_body import RobotBody
from sim.mujoco_world.stage import Act, CannotDo, Ending, Stage, Step, Steps, face, stow

BASKET_OPENING_M = 0.012
"""In a basket the fingers open only this much, so as not to push against its walls."""

CLOSE_IN_M = 1.15
CLOSE_IN_M_S = 0.25
APART_M = 0.03
"""Between two robots' footprints when one reaches into the other's basket."""

SLOT_GAP_M = 0.06
"""Room for the fingers between two objects in a basket."""


def release_in_basket(stage: Stage, act: Act, motion: Motion) -> Steps:
    """Let the held object down into a free spot of another robot's basket."""
    assert motion.robot is not None
    robot, other = act.robot, stage.robots[motion.robot]
    hand_of(robot)
    held = held_by(robot)
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
        yield from let_down(act, path, held, BASKET_OPENING_M)
    except CannotDo:
        yield from stow(act)
        yield from _drive_straight(act, start, "backing off")
        raise
    yield from _drive_straight(act, start, "backing off")
    return Ending()


def _above_a_spot(
    stage: Stage, act: Act, spots: list[PointM], other: RobotBody
) -> Generator[None, None, Reach]:
    """Stand before the nearest spot that the hand can get to; how it gets there.

    Raises:
        CannotDo: why the last one cannot be reached.
    """
    robot = act.robot
    arm, _ = hand_of(robot)
    failure = CannotDo("")
    for spot in sorted(spots, key=lambda spot: distance_m(act, spot)):
        try:
            yield from face(act, spot[0], spot[1])
            yield from _close_in(stage, act, spot, other)
            target = (spot[0], spot[1], spot[2] + robot.grip_above_base_m + RELEASE_LIFT_M)
            return reach_down(arm, target, None)
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
        for solid in solids(stage.world):
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


def _free_spots(stage: Stage, other: RobotBody, held: str) -> list[PointM]:
    """Points on a basket's floor where the held object has room, world frame."""
    half_x, half_y, _ = other.basket_half_m
    pitch = width_m(stage, held) + SLOT_GAP_M
    across, along = (max(1, int(2 * half / pitch)) for half in (half_x, half_y))
    taken = [
        (stage.observer.base_point(name), width_m(stage, name))
        for name in stage.observer.basket(other)
    ]
    spots = []
    for column in range(across):
        for row in range(along):
            spot = other.basket_point(
                half_x * (2 * column + 1 - across) / across, half_y * (2 * row + 1 - along) / along
            )
            if all(
                math.dist(spot[:2], at[:2]) > (width + width_m(stage, held)) / 2
                for at, width in taken
            ):
                spots.append(spot)
    return spots
