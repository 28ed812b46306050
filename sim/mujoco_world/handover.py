"""Handing over: letting what the hand holds down into another robot's basket."""

from __future__ import annotations

import math
from collections.abc import Generator

from keyexpr_schema.payloads.motions import PointM
from sim.mujoco_world.base_motions import distance_m
from sim.mujoco_world.grasping import (
    BASKET_OPENING_M,
    RELEASE_LIFT_M,
    grasp,
    hand_of,
    held_by,
    let_down,
    width_m,
)
from sim.mujoco_world.motion import (
    MotionContext,
    MotionFailed,
    MotionRun,
    Step,
    Steps,
    drive_straight,
    face,
    stow,
)
from sim.mujoco_world.reaching import Reach, reach_down
from sim.mujoco_world.robot_body import RobotBody

CLOSE_IN_M = 1.15
CLOSE_IN_M_S = 0.25
APART_M = 0.03
"""Between two robots' footprints when one reaches into the other's basket."""

SLOT_GAP_M = 0.06
"""Room for the fingers between two objects in a basket."""


def release_in_basket(context: MotionContext, run: MotionRun) -> Steps:
    """Let the held object down into a free spot of another robot's basket."""
    assert run.motion.robot is not None
    robot, other = run.robot, context.robots[run.motion.robot]
    hand_of(robot)
    held = held_by(robot)
    if other.basket < 0:
        raise MotionFailed(f"{other.name} has no basket")
    lying = context.observer.basket(other)
    room = int(other.spec.capabilities.get("basket", 0))
    if len(lying) >= room:
        raise MotionFailed(f"the basket of {other.name} is full: it holds {', '.join(lying)}")
    run.guest_of = other.name
    run.handling = True
    yield from stow(run)
    run.phase = f"waiting for {other.name} to stand still"
    while other.moving():
        yield
    spots = (
        _free_spots(context, other, held) if run.motion.point_m is None else [run.motion.point_m]
    )
    if not spots:
        raise MotionFailed(f"there is no free spot in the basket of {other.name}")
    start = robot.pose()
    try:
        path = yield from _above_a_spot(context, run, spots, other)
        yield from let_down(run, path, held, BASKET_OPENING_M)
    except MotionFailed:
        yield from stow(run)
        yield from drive_straight(run, start, "backing off")
        raise
    yield from drive_straight(run, start, "backing off")
    return ()


def take(context: MotionContext, run: MotionRun) -> Steps:
    """Close the hand on an object: where it lies, or in the basket of the robot that is named."""
    if run.motion.robot is None:
        return (yield from grasp(context, run))
    other = context.robots[run.motion.robot]
    name = run.motion.object
    assert name is not None
    if other.basket < 0:
        raise MotionFailed(f"{other.name} has no basket")
    run.guest_of = other.name
    run.handling = True
    yield from stow(run)
    run.phase = f"waiting for {other.name} to stand still"
    while other.moving():
        yield
    if name not in context.observer.basket(other):
        raise MotionFailed(f"{name} is not in the basket of {other.name}")
    start = run.robot.pose()
    point = context.observer.base_point(name)
    try:
        yield from face(run, point[0], point[1])
        yield from _close_in(context, run, point, other)
        yield from grasp(context, run)
    except MotionFailed:
        yield from stow(run)
        yield from drive_straight(run, start, "backing off")
        raise
    yield from drive_straight(run, start, "backing off")
    return ()


def _above_a_spot(
    context: MotionContext, run: MotionRun, spots: list[PointM], other: RobotBody
) -> Generator[None, None, Reach]:
    """Stand before the nearest spot that the hand can get to; how it gets there.

    Raises:
        MotionFailed: why the last one cannot be reached.
    """
    robot = run.robot
    arm, _ = hand_of(robot)
    failure = MotionFailed("")
    for spot in sorted(spots, key=lambda spot: distance_m(run, spot)):
        try:
            yield from face(run, spot[0], spot[1])
            yield from _close_in(context, run, spot, other)
            target = (spot[0], spot[1], spot[2] + robot.grip_above_base_m + RELEASE_LIFT_M)
            return reach_down(arm, target, None)
        except MotionFailed as error:
            failure = error
    raise failure


def _close_in(context: MotionContext, run: MotionRun, spot: PointM, other: RobotBody) -> Step:
    """Drive straight on until a spot in another robot's basket is within reach.

    Raises:
        MotionFailed: it is too far, or something stands between.
    """
    robot = run.robot
    assert robot.arm is not None
    least, greatest = robot.arm.entry.reach_m
    distance = distance_m(run, spot)
    if distance <= greatest:
        return
    if distance > CLOSE_IN_M:
        raise MotionFailed(
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
        raise MotionFailed(f"to reach that spot it would run into {other.name}")
    blocker = in_the_way(context, run, other, (x, y), goal[:2])
    if blocker is not None:
        raise MotionFailed(f"{blocker} is in the way to the basket of {other.name}")
    yield from drive_straight(run, goal, f"driving up to {other.name}")


def in_the_way(
    context: MotionContext,
    run: MotionRun,
    host: RobotBody | None,
    start: tuple[float, float],
    goal: tuple[float, float],
) -> str | None:
    """What a straight drive would run into, walls and furniture as well as robots."""
    robot = run.robot
    room = robot.description.clearance_m
    standing = context.standing()
    for step in range(11):
        share = step / 10
        x, y = (a + share * (b - a) for a, b in zip(start, goal, strict=True))
        for solid in standing:
            if solid.distance_m(x, y) < room:
                return solid.name
        for other in context.robots.values():
            if other in (robot, host):
                continue
            if math.dist(other.pose()[:2], (x, y)) < room + other.description.clearance_m:
                return other.name
    return None


def _free_spots(context: MotionContext, other: RobotBody, held: str) -> list[PointM]:
    """Points on a basket's floor where the held object has room, world frame."""
    half_x, half_y, _ = other.basket_half_m
    pitch = width_m(context, held) + SLOT_GAP_M
    across, along = (max(1, int(2 * half / pitch)) for half in (half_x, half_y))
    taken = [
        (context.observer.base_point(name), width_m(context, name))
        for name in context.observer.basket(other)
    ]
    spots = []
    for column in range(across):
        for row in range(along):
            spot = other.basket_point(
                half_x * (2 * column + 1 - across) / across, half_y * (2 * row + 1 - along) / along
            )
            if all(
                math.dist(spot[:2], at[:2]) > (width + width_m(context, held)) / 2
                for at, width in taken
            ):
                spots.append(spot)
    return spots
