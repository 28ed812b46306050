"""Getting a hand to a point: from where, which way, and without touching anything on it.

The hand always points down; it comes from above, or unfolded from the front.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

from keyexpr_schema.payloads.motions import PointM
from keyexpr_schema.payloads.robots import PoseMRad
from sim.mujoco_world.arm import Arm
from sim.mujoco_world.motion import (
    MotionContext,
    MotionFailed,
    MotionRun,
    Step,
    check_way,
    drive_straight,
    move_arm,
)

HOVERS_M = (0.15, 0.12, 0.09, 0.06)
"""How far above its last position the hand comes in, the first that the arm can reach."""

RIM_M = 0.03
"""How far fingers pass above an edge."""

ROOM_M = 0.38
"""So far from where it reaches in under a roof a robot unfolds its arm."""

GAP_M = 0.012
"""An arm that unfolds keeps so far from what stands there, if it can: it lags behind a little."""

ASIDE_M = 0.02
"""A hand that gets no farther aside than this comes straight down around an object."""

BACKS_M = (0.0, 0.12, 0.22, ROOM_M)
"""So far from any other point: the first that will do."""

REACH_IN_M_S = 0.12


@dataclass(frozen=True)
class Reach:
    """Joint values above a point and at it.

    `upright`: the hand comes straight down between them; `opening_m`: how far each finger is from
    the middle meanwhile, if not as it is.
    """

    above: list[float]
    at: list[float]
    upright: bool = True
    opening_m: float | None = None


def reach_over(
    context: MotionContext, run: MotionRun, point: PointM, path: Reach, slower: float = 1.0
) -> Step:
    """Bring the hand above a point: from above or, where something is in the way of the arm as it
    unfolds (a roof, a drawer's neighbour), from the front.

    Raises:
        MotionFailed: something is in the way.
    """
    back_m = unfolding_m(context, run, run.robot.pose(), point, path)
    if back_m > 0.0:
        yield from reach_in(context, run, path, back_m, slower)
    else:
        yield from move_arm(run, path.above, "moving the hand above the point", slower=slower)


def unfolding_m(
    context: MotionContext, run: MotionRun, pose: PoseMRad, point: PointM, path: Reach
) -> float:
    """How far behind a pose the arm unfolds without touching anything [m].

    Raises:
        MotionFailed: what it touches, or what stands there.
    """
    robot = run.robot
    arm = robot.arm
    assert arm is not None
    roofed = context.world.fixtures.roof_over(point) is not None
    failure = None
    backs = ((ROOM_M,) if roofed else BACKS_M) if robot.drives else (0.0,)
    for gap_m, back_m in itertools.product((GAP_M, 0.0), backs):
        back = behind(pose, back_m)
        try:
            if back_m > 0.0:
                run.phase = "standing back"
                check_way(context, run, [pose[:2], back[:2]])
        except MotionFailed as error:
            failure = failure or error
            continue
        with robot.imagined(back, path.opening_m):
            hit = None if roofed else arm.obstacle_between(path.above, arm.entry.stow, gap_m)
        if hit is None:
            return back_m
        failure = failure or touches(hit)
    assert failure is not None
    raise failure


def fitting(
    context: MotionContext, run: MotionRun, point: PointM, path_to: Callable[[], Reach]
) -> Callable[[PoseMRad], bool]:
    """Whether a robot that stands at a pose, its arm folded, gets its hand to a point."""

    def fits(pose: PoseMRad) -> bool:
        with run.robot.imagined(pose):
            try:
                path = path_to()
            except MotionFailed:
                return False
        if not path.upright:
            return False
        try:
            unfolding_m(context, run, pose, point, path)
        except MotionFailed:
            return False
        return True

    return fits


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


def hovers_m(
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

    The first seed that works; one with which the hand comes straight down, if there is one: where
    the elbow goes over to its other bend, it swings out, and into what it is to take.

    Raises:
        MotionFailed: there are none.
    """
    x, y, z = target
    touched = swinging = None
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
                if hit is not None:
                    touched = hit
                elif arm.strays_m(above, at) <= ASIDE_M:
                    return Reach(above=above, at=at)
                else:
                    swinging = swinging or Reach(above=above, at=at, upright=False)
    if swinging is not None:
        return swinging
    if touched is not None:
        raise touches(touched)
    raise MotionFailed(
        f"the hand cannot get to ({x:.2f}, {y:.2f}, {z:.2f}) from where the robot stands"
    )


def touches(name: str) -> MotionFailed:
    """The failure of an arm that something is in the way of."""
    return MotionFailed(f"the arm would touch {name}: approach the point from another side", name)
