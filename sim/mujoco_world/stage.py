"""What motions are made of: the stage they play on, how they end, and small common steps.

A motion is a generator that is resumed once a control period; it ends by returning an `Ending` or
raising `CannotDo`. Nothing in it waits for wall time, so a run is repeatable.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass, field

from keyexpr_schema.payloads.motions import Detection
from sim.files.world_schema import WorldFile
from sim.mujoco_world.drives import PERIOD_S, wrap
from sim.mujoco_world.observer import Observer
from sim.mujoco_world.robot_body import RobotBody
from sim.navigation import Leg, Navigator

Steps = Generator[None, None, "Ending"]
Step = Generator[None, None, None]

FACING_RAD = 0.006
"""5 mm off at an arm's length; the fingers open wider than that."""


BLOCKED_S = 2.5
"""An arm that is not where it was told to be this long after is held up by something."""


class CannotDo(Exception):
    """A motion fails. The message is one sentence for a person."""


@dataclass(frozen=True)
class Ending:
    """A motion that succeeded, and what was seen on the way."""

    detections: tuple[Detection, ...] = ()


@dataclass
class Stage:
    """Everything a motion may look at or use."""

    world: WorldFile
    robots: dict[str, RobotBody]
    navigator: Navigator
    observer: Observer
    time_s: Callable[[], float]
    legs: dict[str, Leg] = field(default_factory=dict)


@dataclass
class Act:
    """One robot's running motion. `phase` says what it is at, for reasons of failure.

    `manual`: the motion drives the base itself, not the navigator.
    `guest_of`: the robot into whose basket it reaches; that one must stand still.
    `handling`: the hand is near things, and touches of it do not count as collisions.
    """

    robot: RobotBody
    phase: str = "starting"
    manual: bool = False
    handling: bool = False
    guest_of: str | None = None


def wait(seconds: float) -> Step:
    """Let simulated time pass."""
    for _ in range(max(1, round(seconds / PERIOD_S))):
        yield


def face(act: Act, x_m: float, y_m: float) -> Step:
    """Turn on the spot until the robot's x axis points at (x, y)."""
    act.phase = "turning to face the point"
    drive = act.robot.drive
    if not act.manual:
        act.manual = True
        drive.halt()
    x, y, _ = act.robot.pose()
    heading = math.atan2(y_m - y, x_m - x)
    drive.turn_to(heading)
    steady = 0
    while steady < 3:
        yield
        error = abs(wrap(heading - act.robot.pose()[2]))
        steady = steady + 1 if error < FACING_RAD and drive.speed()[1] < 0.05 else 0


def move_arm(act: Act, goal: list[float], phase: str, slower: float = 1.0) -> Step:
    """Move the joints to `goal`, all arriving together.

    Raises:
        CannotDo: something holds the arm up.
    """
    arm = act.robot.arm
    assert arm is not None
    act.phase = phase
    arm.goal = list(goal)
    arm.slowness = slower
    overdue = 0.0
    while not arm.arrived():
        yield
        overdue = overdue + PERIOD_S if arm.commanded() else 0.0
        if overdue > BLOCKED_S:
            raise CannotDo(f"something blocks the arm while {phase}")
    arm.slowness = 1.0


def stow(act: Act) -> Step:
    """Fold the arm into its carrying pose; from near things, straight up first."""
    robot = act.robot
    arm = robot.arm
    if arm is None or arm.stowed():
        return
    act.phase = "folding the arm"
    x, y, z = arm.grip_point()
    radius = math.dist(robot.pose()[:2], (x, y))
    if radius > robot.description.clearance_m:
        for rise in (0.15, 0.10, 0.06, 0.03):
            above = arm.solve((x, y, z + rise), arm.setpoint)
            if above is not None:
                yield from move_arm(act, above, "raising the hand")
                break
    yield from move_arm(act, list(arm.entry.stow), "folding the arm")
    if robot.held is None and robot.gripper is not None:
        robot.gripper.open(0.0)
