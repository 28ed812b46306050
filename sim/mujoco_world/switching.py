"""Switches are touched: a fingertip presses a button from above until it changes over."""

from __future__ import annotations

from keyexpr_schema.facts import IS_ON
from keyexpr_schema.payloads.motions import MotionKind
from sim.mujoco_world.base_controllers import PERIOD_S
from sim.mujoco_world.base_motions import reach_m, stand_at
from sim.mujoco_world.grasping import hand_of
from sim.mujoco_world.motion import (
    MotionContext,
    MotionFailed,
    MotionRun,
    Step,
    Steps,
    face,
    move_arm,
    stow,
)

HOVERS_M = (0.10, 0.06)
PRESSES_M = 0.012
"""A finger is told to go so far into a button: it gets to its surface, and presses."""
TOUCH_S = 3.0


def switch(context: MotionContext, run: MotionRun) -> Steps:
    """Switch something on or off, unless it is so already."""
    thing, robot = run.motion.object, run.robot
    assert thing is not None
    wanted = run.motion.kind is MotionKind.SWITCH_ON
    states = context.mechanisms.states
    if states.get(thing, IS_ON) is wanted:
        return ()
    arm, gripper = hand_of(robot)
    if robot.held is not None:
        raise MotionFailed(f"the hand is not empty: it holds {robot.held}")
    yield from stow(run)
    fixture, button = context.world.fixtures.buttons[thing]
    point = fixture.point_m(button.top_m)
    run.phase = f"driving up to the switch of {thing}"
    yield from stand_at(context, run, point, reach_m(run), fixture.inward_rad)
    run.handling = True
    yield from face(run, point[0], point[1])
    gripper.open(0.0)
    x, y, z = point
    z += gripper.entry.finger_depth_m
    for seed in arm.entry.seeds:
        for hover in HOVERS_M:
            above = arm.solve((x, y, z + hover), seed)
            at = arm.solve((x, y, z - PRESSES_M), seed if above is None else above)
            if above is not None and at is not None and arm.obstacle(above) is None:
                yield from _press(context, run, above, at, wanted)
                return ()
    raise MotionFailed(f"the finger cannot get to the switch of {thing} from where it stands")


def _press(
    context: MotionContext, run: MotionRun, above: list[float], at: list[float], wanted: bool
) -> Step:
    """Go down on the button until it changes over, and up again.

    Raises:
        MotionFailed: it does not.
    """
    thing, robot, states = run.motion.object, run.robot, context.mechanisms.states
    assert thing is not None and robot.arm is not None
    yield from move_arm(run, above, "moving the finger above the switch")
    run.phase = f"pressing the switch of {thing}"
    robot.arm.goal = list(at)
    robot.arm.slowness = 3.0
    waited = 0.0
    while states.get(thing, IS_ON) is not wanted and waited < TOUCH_S:
        yield
        waited += PERIOD_S
    robot.arm.freeze()
    yield from move_arm(run, above, "withdrawing the finger")
    yield from stow(run)
    if states.get(thing, IS_ON) is not wanted:
        raise MotionFailed(f"the switch of {thing} was not felt to change over")
