"""Opening and closing: the hand closes on a handle, and the base drives it along its way."""

from __future__ import annotations

import math
from itertools import pairwise

from sim.mujoco_world.base_controllers import PERIOD_S
from sim.mujoco_world.base_motions import distance_m, reach_m, stand_at
from sim.mujoco_world.grasping import RELEASE_OPENING_M, close_on, hand_of
from sim.mujoco_world.motion import (
    MotionContext,
    MotionFailed,
    MotionRun,
    Step,
    Steps,
    check_way,
    face,
    move_arm,
    stow,
    wait,
)
from sim.mujoco_world.reaching import Reach, behind, fitting, reach_down, reach_in
from sim.navigation.clearance import Clearance

PULL_M_S = 0.12
LIMIT_M_S = 0.3
STUCK_S = 4.0
"""A handle that has not come to where it was pulled this long after is stuck."""
NEAR_SHARE = 0.08
SAMPLES = 8
DOOR_GAP_M = 0.02
BACK_M = 0.22
"""So far from a handle a robot unfolds its arm, and folds it again."""


def open_thing(context: MotionContext, run: MotionRun) -> Steps:
    """Open a door or a drawer as wide as it goes."""
    yield from _swing(context, run, 1.0)
    return ()


def close_thing(context: MotionContext, run: MotionRun) -> Steps:
    """Close a door or a drawer."""
    yield from _swing(context, run, 0.0)
    return ()


def _swing(context: MotionContext, run: MotionRun, goal: float) -> Step:
    """Drive up to the handle, take it, and bring it to where the thing is open (1) or closed (0).

    Raises:
        MotionFailed: why it is not there in the end.
    """
    thing, robot, mechanisms = run.motion.object, run.robot, context.mechanisms
    assert thing is not None
    if abs(mechanisms.opening(thing) - goal) <= NEAR_SHARE:
        return
    arm, gripper = hand_of(robot)
    if robot.held is not None:
        raise MotionFailed(f"the hand is not empty: it holds {robot.held}")
    if not robot.drives:
        raise MotionFailed(
            f"{robot.name} does not drive, as one must with a door in hand", retryable=False
        )
    yield from stow(run)
    run.phase = f"driving up to the handle of {thing}"
    fixture = context.world.fixtures.movers[thing][0]
    point = mechanisms.handle_m(thing)

    def path_to() -> Reach:
        with robot.imagined(opening_m=gripper.entry.open_m):
            return reach_down(arm, point, None)

    fits = fitting(context, run, point, path_to)
    yield from stand_at(context, run, point, reach_m(run), fixture.inward_rad, fits=fits)
    run.handling = True
    yield from face(run, point[0], point[1])
    way = _handle_way(context, thing, goal)
    base = robot.drive.led(way, distance_m(run, point))
    ends = [behind(base[k], BACK_M)[:2] for k in (0, -1)]
    whole = [ends[0], *(pose[:2] for pose in base), ends[1]]
    run.phase = f"moving the door of {thing}"
    check_way(context, run, whole, but=(fixture.name, *(m.thing for m in fixture.movers)))
    if min(Clearance(context.world, context.solids).at(whole)) < robot.description.radius_m:
        raise MotionFailed(f"{fixture.name} itself is in the way of who moves its door")
    _check_door(context, thing, goal)
    run.phase = "waiting for room to move the door"
    # The door must not hit anybody, either.
    while not context.navigator.reserve(robot.name, [*whole, *reversed(way)]):
        yield
    gripper.open()
    yield from wait(0.6)
    path = reach_down(arm, mechanisms.handle_m(thing), None)
    try:
        yield from reach_in(context, run, path, BACK_M)
        yield from move_arm(run, path.at, "lowering the hand", slower=1.5)
        yield from close_on(run, gripper, f"the handle of {thing}")
        yield from _pull(context, run, goal)
    except MotionFailed:
        yield from _withdraw(context, run, path)
        raise
    yield from _withdraw(context, run, path)
    if abs(mechanisms.opening(thing) - goal) > 2 * NEAR_SHARE:
        raise MotionFailed(
            f"{thing} has not stayed {'open' if goal else 'closed'}: it is open "
            f"{mechanisms.opening(thing):.0%} of its way"
        )


def _handle_way(context: MotionContext, thing: str, goal: float) -> list[tuple[float, float]]:
    """Where the handle gets to on its way, on the floor plan."""
    _, mover = context.world.fixtures.movers[thing]
    now = context.mechanisms.opening(thing)
    found = []
    for k in range(SAMPLES + 1):
        share = now + (goal - now) * k / SAMPLES
        x, y, _ = context.world.fixtures.moved_m(thing, mover.handle_m, share)
        found.append((x, y))
    return found


def _check_door(context: MotionContext, thing: str, goal: float) -> None:
    """Raises `MotionFailed` where a door or drawer would run into another that is open."""
    fixture, mover = context.world.fixtures.movers[thing]
    own = {other.thing for other in fixture.movers}
    others = [solid for solid in context.mechanisms.obstacles() if solid.name not in own]
    (x, y, z), (half_x, _, _) = mover.panels[0].center_m, mover.panels[0].half_m
    edge = [(x + share * half_x, y, z) for share in (-1.0, -0.5, 0.0, 0.5, 1.0)]
    now = context.mechanisms.opening(thing)
    for k in range(SAMPLES + 1):
        share = now + (goal - now) * k / SAMPLES
        for point in (*edge, mover.handle_m):
            at = context.world.fixtures.moved_m(thing, point, share)
            for solid in others:
                if solid.distance_m(at[0], at[1]) < DOOR_GAP_M:
                    raise MotionFailed(f"{solid.name} is in the way of {thing}", solid.name)


def _pull(context: MotionContext, run: MotionRun, goal: float) -> Step:
    """Drive the base so that the hand follows the handle's way.

    Raises:
        MotionFailed: the handle does not come along.
    """
    thing, drive, mechanisms = run.motion.object, run.robot.drive, context.mechanisms
    assert thing is not None
    run.phase = f"{'opening' if goal else 'closing'} {thing}"
    _, mover = context.world.fixtures.movers[thing]
    moved = context.world.fixtures.moved_m
    share = mechanisms.opening(thing)
    ahead_m = distance_m(run, mechanisms.handle_m(thing))
    way = _handle_way(context, thing, goal)
    length = sum(math.dist(a, b) for a, b in pairwise(way))
    step = (goal - share) * PULL_M_S * PERIOD_S / max(length, 1e-6)
    late_s = 0.0
    while abs(mechanisms.opening(thing) - goal) > NEAR_SHARE / 2 or share != goal:
        share = goal if abs(goal - share) <= abs(step) else share + step
        at = moved(thing, mover.handle_m, share)
        drive.lead(at[:2], ahead_m, LIMIT_M_S)
        # Where to go from here, should it be stopped.
        run.robot.way_out = behind(run.robot.pose(), BACK_M)
        yield
        late_s = late_s + PERIOD_S if share == goal else 0.0
        if late_s > STUCK_S:
            raise MotionFailed(
                f"{thing} is stuck {mechanisms.opening(thing):.0%} open while {run.phase}"
            )
    drive.halt()
    yield from wait(0.3)


def _withdraw(context: MotionContext, run: MotionRun, path: Reach) -> Step:
    """Let go of the handle, raise the hand and fold the arm."""
    robot = run.robot
    _, gripper = hand_of(robot)
    robot.drive.halt()
    robot.let_go()
    gripper.open(gripper.opening_m() + RELEASE_OPENING_M)
    yield from wait(0.5)
    if robot.way_out is not None:
        yield from move_arm(run, path.above, "withdrawing the hand")
        robot.way_out = behind(robot.pose(), BACK_M)
    yield from stow(run)
    context.navigator.settle(robot.name)
