"""Coming up to a point, so that the hand gets to what is there."""

from __future__ import annotations

import math
from functools import partial

from keyexpr_schema.payloads.motions import PointM
from sim.mujoco_world.base_motions import reach_m, reach_to_m, stand_at
from sim.mujoco_world.grasping import path_to_grip
from sim.mujoco_world.motion import MotionContext, MotionFailed, MotionRun, Steps, stow
from sim.mujoco_world.reaching import fitting

SAME_POINT_M = 0.1
"""Where the hand could not get to a point this near, the next try stands elsewhere."""

BESIDE_ROBOT_M = (0.60, 0.95)
"""How far from a point on another robot it stops: outside of the room that traffic gives that."""


def approach(context: MotionContext, run: MotionRun) -> Steps:
    """Drive to where the hand reaches a point; with an object named, to where it gets to that."""
    point = run.motion.point_m
    assert point is not None
    yield from stow(run)
    run.phase = "driving up to the point"
    host = _robot_at(context, run, point)
    if host is not None:
        # It must not make way now; and it needs its room, so the last bit is driven by the motion
        # that reaches into its basket.
        run.guest_of = host
        yield
    reach = reach_to_m(context, run, point) if host is None else BESIDE_ROBOT_M
    in_vain = [at for other, at in run.robot.in_vain if math.dist(other, point) < SAME_POINT_M]
    if not run.robot.drives:
        reach = reach_m(run)
    fits = None
    name = run.motion.object
    if name is not None and host is None and run.robot.arm is not None:
        path_to = partial(path_to_grip, context, run.robot, name, point)
        fits = fitting(context, run, point, path_to)
    try:
        yield from stand_at(context, run, point, reach, in_vain=in_vain, fits=fits)
    except MotionFailed as error:
        # Of what it is in, the front keeps who stands before it away, open or closed.
        if name is not None and error.blocked_by in _around(context, name):
            sentence = f"{name} in {error.blocked_by} is out of reach of {run.robot.name}"
            raise MotionFailed(sentence, retryable=False) from None
        raise
    return ()


def _around(context: MotionContext, name: str) -> list[str]:
    """What carries an object: directly, and so on."""
    supports = {truth.object: truth.support for truth in context.observer.truths(0.0)}
    found: list[str] = []
    carrier = supports.get(name)
    while carrier is not None and carrier not in found:
        found.append(carrier)
        carrier = supports.get(carrier)
    return found


def _robot_at(context: MotionContext, run: MotionRun, point: PointM) -> str | None:
    """The other robot on whose footprint a point lies."""
    for name, other in context.robots.items():
        near = math.dist(other.pose()[:2], point[:2]) < other.description.radius_m
        if near and name != run.robot.name:
            return name
    return None
