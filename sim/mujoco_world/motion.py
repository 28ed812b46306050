"""What motions are made of: what they may use, how they end, and small common steps.

A motion is a generator that is resumed once a control period; it ends by returning what was seen
on the way, or by raising `MotionFailed`. Nothing in it waits for wall time, so a run is repeatable.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Generator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

from keyexpr_schema.payloads.motions import Detection, Motion, MotionOutcome
from keyexpr_schema.payloads.robots import PoseMRad
from sim.batteries import Batteries
from sim.files.solids import Solid, solids
from sim.files.world_schema import WorldFile
from sim.mujoco_world.base_controllers import PERIOD_S, wrap
from sim.mujoco_world.mechanisms import Mechanisms
from sim.mujoco_world.observer import Observer
from sim.mujoco_world.robot_body import RobotBody
from sim.navigation import Leg, Navigator

Steps = Generator[None, None, tuple[Detection, ...]]
"""A whole motion."""
Step = Generator[None, None, None]
"""A part of one."""

FACING_RAD = 0.006
"""5 mm off at an arm's length; the fingers open wider than that."""

BLOCKED_S = 2.5
"""An arm that is not at its setpoints this long after is held up by something."""


NEAR_M = 0.02
"""A base this close to where it was driven by hand is there."""


HELD_UP_S = 5.0

WAY_STEP_M = 0.05
"""So close to each other it is looked whether something stands on a way."""


class MotionFailed(Exception):
    """A motion fails. The message is one sentence for a person.

    `blocked_by` is what was in the way; if it is open, it could be closed. `retryable`: trying
    again could help.
    """

    def __init__(
        self, sentence: str, blocked_by: str | None = None, retryable: bool = True
    ) -> None:
        super().__init__(sentence)
        self.blocked_by = blocked_by
        self.retryable = retryable


@dataclass
class MotionContext:
    """Everything a motion may look at or use."""

    world: WorldFile
    robots: dict[str, RobotBody]
    navigator: Navigator
    observer: Observer
    mechanisms: Mechanisms
    batteries: Batteries
    taken: Callable[[str, str], str | None]
    """Why a robot (the second) cannot dock at a charger."""
    legs: dict[str, Leg] = field(default_factory=dict)

    @cached_property
    def solids(self) -> tuple[Solid, ...]:
        """What stands on the floor."""
        return solids(self.world)

    def standing(self) -> tuple[Solid, ...]:
        """What stands on the floor now, doors and drawers that are open among it."""
        return (*self.solids, *self.mechanisms.obstacles())


@dataclass
class MotionRun:
    """A robot's latest motion. `phase` says what it is at, for reasons of failure.

    `manual`: the motion drives the base itself, not the navigator.
    `guest_of`: the robot into whose basket it reaches; that one must stand still.
    `handling`: the hand is near things, and touches of it do not count as collisions.
    `ended` is `None` while it runs. `docked_at` is the charger that it charges at.
    """

    robot: RobotBody
    motion: Motion
    began_s: float
    steps: Steps = field(init=False)
    ended: MotionOutcome | None = None
    phase: str = "starting"
    manual: bool = False
    handling: bool = False
    guest_of: str | None = None
    docked_at: str | None = None


def check_way(
    context: MotionContext,
    run: MotionRun,
    way: Sequence[tuple[float, float]],
    *,
    but: Collection[str] = (),
) -> None:
    """Raises `MotionFailed` where the base, driving along `way`, would run into something other
    than `but`."""
    radius = run.robot.description.radius_m
    others = [solid for solid in context.standing() if solid.name not in but]
    for (x1, y1), (x2, y2) in pairwise(way):
        steps = max(1, math.ceil(math.dist((x1, y1), (x2, y2)) / WAY_STEP_M))
        for k in range(steps + 1):
            x, y = x1 + (x2 - x1) * k / steps, y1 + (y2 - y1) * k / steps
            for solid in others:
                if solid.distance_m(x, y) < radius:
                    sentence = f"{solid.name} is in the way of {run.robot.name} {run.phase}"
                    raise MotionFailed(sentence, solid.name)


def wait(seconds: float) -> Step:
    """Let simulated time pass."""
    for _ in range(max(1, round(seconds / PERIOD_S))):
        yield


def face(run: MotionRun, x_m: float, y_m: float) -> Step:
    """Turn on the spot until the robot's x axis points at (x, y)."""
    run.phase = "turning to face the point"
    drive = run.robot.drive
    if not run.manual:
        run.manual = True
        drive.halt()
    x, y, _ = run.robot.pose()
    heading = math.atan2(y_m - y, x_m - x)
    drive.turn_to(heading)
    steady = 0
    while steady < 3:
        yield
        error = abs(wrap(heading - run.robot.pose()[2]))
        steady = steady + 1 if error < FACING_RAD and drive.speed()[1] < 0.05 else 0


def move_arm(run: MotionRun, goal: list[float], phase: str, slower: float = 1.0) -> Step:
    """Move the joints to `goal`, all arriving together.

    Raises:
        MotionFailed: something holds the arm up.
    """
    arm = run.robot.arm
    assert arm is not None
    run.phase = phase
    arm.goal = list(goal)
    arm.slowness = slower
    overdue = 0.0
    while not arm.arrived():
        yield
        overdue = overdue + PERIOD_S if arm.commanded() else 0.0
        if overdue > BLOCKED_S:
            raise MotionFailed(f"something blocks the arm while {phase}")
    arm.slowness = 1.0


def stow(run: MotionRun) -> Step:
    """Fold the arm into its carrying pose; from near things, straight up first."""
    robot = run.robot
    arm = robot.arm
    if arm is None or arm.stowed():
        robot.way_out = None
        return
    run.phase = "folding the arm"
    if robot.way_out is not None and robot.held is None and robot.gripper is not None:
        # It was stopped with its fingers round a handle, or about to take something.
        robot.gripper.open()
        yield from wait(0.6)
    x, y, z = arm.grip_point()
    radius = math.dist(robot.pose()[:2], (x, y))
    if radius > robot.description.clearance_m:
        for rise in (0.15, 0.10, 0.06, 0.03) if robot.way_out is None else (0.03, 0.015):
            above = arm.solve((x, y, z + rise), arm.setpoint)
            if above is not None and arm.obstacle(above) is None:
                yield from move_arm(run, above, "raising the hand")
                break
    if robot.way_out is not None:
        yield from drive_straight(run, robot.way_out, "drawing the arm out")
        robot.way_out = None
    yield from move_arm(run, list(arm.entry.stow), "folding the arm")
    if robot.held is None and robot.gripper is not None:
        robot.gripper.open(0.0)


def drive_straight(run: MotionRun, goal: PoseMRad, phase: str, speed_m_s: float = 0.25) -> Step:
    """Move the base without the navigator, slowly, to a pose close by.

    Raises:
        MotionFailed: it stands still before it is there.
    """
    run.phase = phase
    run.manual = True
    drive = run.robot.drive
    drive.drive(*goal, speed_m_s, backs=True)
    still_s = 0.0
    while True:
        yield
        x, y, yaw = run.robot.pose()
        near = math.dist((x, y), goal[:2]) < NEAR_M and abs(wrap(yaw - goal[2])) < 0.02
        if near and not run.robot.moving():
            return
        still_s = 0.0 if run.robot.moving() else still_s + PERIOD_S
        if still_s > HELD_UP_S:
            drive.halt()
            raise MotionFailed(f"something holds {run.robot.name} up while {phase}")
