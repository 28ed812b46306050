"""Base controllers: from a target point to velocity commands, once a control period."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any

from keyexpr_schema.payloads.robots import PoseMRad
from sim.mujoco_world.assemble import yaw_of, yaw_quaternion
from sim.mujoco_world.description import Description, DifferentialDrive, FixedBase, PlanarDrive

PERIOD_S = 0.05
"""Control period."""

NEAR_M = 0.015
"""A wheeled base this close to its target has arrived; turning on the spot for less is noise."""

LEAVES_M = 0.025

GAIN_1_S = 3.0
"""Speed commanded for each metre of distance: settles in about a second, below the servo's band."""

YAW_GAIN_1_S = 4.0

CARRYING_RAD_S = 0.5
"""Turning rate with something in the hand. Friction has no memory of place: in a turn, each physics
step of `dt` leaves a held object `(rate * dt)**2 * radius / 2` farther out, here 0.13 mm/s."""


def wrap(angle_rad: float) -> float:
    """The same angle from -pi to pi."""
    return math.remainder(angle_rad, math.tau)


class Drive(ABC):
    """A robot's base. Its commands are written into the list given to `tick`, one for each motor.

    A list, since single numbers are what controllers read and write: of an array they cost more
    than the controller.
    """

    def __init__(self, data: Any, speed_m_s: float, acceleration: float, yaw_rate: float) -> None:
        self._data = data
        self._top_m_s = speed_m_s
        self._acceleration = acceleration
        self._yaw_rate = yaw_rate
        self.carrying = False
        """Whether the hand is full: then it turns slowly."""
        self._target: tuple[float, float, float | None, float] | None = None
        self._spin: float | None = None
        self._pose_at: tuple[float, PoseMRad] | None = None

    def pose(self) -> PoseMRad:
        """Where the base is: (x, y, yaw), world frame; read once for each moment."""
        now_s = self._data.time
        if self._pose_at is None or self._pose_at[0] != now_s:
            self._pose_at = (now_s, self._read_pose())
        return self._pose_at[1]

    @abstractmethod
    def _read_pose(self) -> PoseMRad: ...

    @abstractmethod
    def put(self, pose_m_rad: PoseMRad) -> None:
        """Set the starting pose (before the simulation runs; nothing is ever moved so after)."""

    @abstractmethod
    def speed(self) -> tuple[float, float]:
        """How fast it moves: m/s, rad/s (both not negative)."""

    @abstractmethod
    def tick(self, ctrl: list[float]) -> None:
        """Write the commands for the next control period."""

    def drive(
        self, x_m: float, y_m: float, yaw_rad: float | None, speed_m_s: float | None = None
    ) -> None:
        """Go to a point, facing `yaw_rad` in the end (`None`: whatever comes)."""
        limit = self._top_m_s if speed_m_s is None else min(self._top_m_s, speed_m_s)
        self._spin = None
        self._target = (x_m, y_m, yaw_rad, limit)

    def turn_to(self, yaw_rad: float) -> None:
        """Turn on the spot."""
        if self._spin is not None or self._target is None or self._target[2] != yaw_rad:
            x, y, _ = self.pose()
            self.drive(x, y, yaw_rad)

    def spin(self, rate_rad_s: float) -> None:
        """Turn on the spot at this rate until the next command."""
        if self._spin is None:
            x, y, _ = self.pose()
            self._target = (x, y, None, self._top_m_s)
        self._spin = rate_rad_s

    def halt(self) -> None:
        """Stay here."""
        x, y, yaw = self.pose()
        self._spin = None
        self._target = (x, y, yaw, self._top_m_s)

    def _approach_speed(self, distance_m: float, limit_m_s: float) -> float:
        """As fast as still lets it stop at the target with the acceleration it has."""
        braking = math.sqrt(2.0 * 0.7 * self._acceleration * distance_m)
        return min(limit_m_s, braking, GAIN_1_S * distance_m)

    def _approach_rate(self, angle_rad: float) -> float:
        return self._limited(YAW_GAIN_1_S * angle_rad)

    def _limited(self, rate_rad_s: float) -> float:
        most = min(self._yaw_rate, CARRYING_RAD_S) if self.carrying else self._yaw_rate
        return max(-most, min(most, rate_rad_s))


class Planar(Drive):
    """Omnidirectional: velocity servos on x, y and yaw. Facing ahead when it has far to go."""

    def __init__(
        self, model: Any, data: Any, prefix: str, entry: PlanarDrive, speed_m_s: float
    ) -> None:
        super().__init__(data, speed_m_s, entry.acceleration_m_s2, entry.yaw_rate_rad_s)
        self._qpos = [int(model.joint(prefix + name).qposadr[0]) for name in entry.joints]
        self._dofs = [int(model.joint(prefix + name).dofadr[0]) for name in entry.joints]
        self._ctrl = [int(model.actuator(prefix + name).id) for name in entry.actuators]
        self._command = (0.0, 0.0, 0.0)

    def _read_pose(self) -> PoseMRad:
        x, y, yaw = (float(self._data.qpos[address]) for address in self._qpos)
        return (x, y, wrap(yaw))

    def put(self, pose_m_rad: PoseMRad) -> None:
        self._data.qpos[self._qpos] = pose_m_rad
        self._pose_at = None
        self.halt()

    def speed(self) -> tuple[float, float]:
        vx, vy, rate = (float(self._data.qvel[address]) for address in self._dofs)
        return (math.hypot(vx, vy), abs(rate))

    def tick(self, ctrl: list[float]) -> None:
        x, y, yaw = self.pose()
        if self._target is None:
            self.halt()
        assert self._target is not None
        to_x, to_y, to_yaw, limit = self._target
        dx, dy = to_x - x, to_y - y
        distance = math.hypot(dx, dy)
        if to_yaw is None or distance > 0.5:
            # facing its way is how people expect a robot to drive, and the camera looks ahead
            to_yaw = math.atan2(dy, dx) if distance > 0.2 else yaw
        rate = (
            self._approach_rate(wrap(to_yaw - yaw))
            if self._spin is None
            else self._limited(self._spin)
        )
        speed = self._approach_speed(distance, limit)
        vx, vy = (dx / distance * speed, dy / distance * speed) if distance > 1e-6 else (0.0, 0.0)
        old_x, old_y, old_rate = self._command
        vx, vy = _turned_into((old_x, old_y), (vx, vy), self._acceleration * PERIOD_S)
        most = 3.0 * self._acceleration * PERIOD_S
        rate = old_rate + max(-most, min(most, rate - old_rate))
        self._command = (vx, vy, rate)
        for motor, value in zip(self._ctrl, self._command, strict=True):
            ctrl[motor] = value


def _turned_into(
    old_m_s: tuple[float, float], new_m_s: tuple[float, float], most_m_s: float
) -> tuple[float, float]:
    """The velocity after a change of at most `most_m_s` towards a new one.

    What leads off the new direction is braked first: else a robot that speeds up along a wall
    around a corner is carried into it.
    """
    change_x, change_y = new_m_s[0] - old_m_s[0], new_m_s[1] - old_m_s[1]
    if math.hypot(change_x, change_y) <= most_m_s:
        return new_m_s
    # Who is to stop has no new direction, and brakes the way it goes.
    ahead_x, ahead_y = new_m_s if any(new_m_s) else old_m_s
    speed = math.hypot(ahead_x, ahead_y)
    ux, uy = ahead_x / speed, ahead_y / speed
    across = max(-most_m_s, min(most_m_s, change_y * ux - change_x * uy))
    left = math.sqrt(most_m_s**2 - across**2)
    along = max(-left, min(left, change_x * ux + change_y * uy))
    return (old_m_s[0] + along * ux - across * uy, old_m_s[1] + along * uy + across * ux)


class Differential(Drive):
    """Two driven wheels: turns towards the target, then drives, then turns to the last heading."""

    def __init__(
        self, model: Any, data: Any, prefix: str, entry: DifferentialDrive, speed_m_s: float
    ) -> None:
        super().__init__(data, speed_m_s, entry.acceleration_m_s2, entry.yaw_rate_rad_s)
        free = model.joint(prefix + entry.joints[0])
        self._qpos = int(free.qposadr[0])
        self._dof = int(free.dofadr[0])
        self._ctrl = [int(model.actuator(prefix + name).id) for name in entry.actuators]
        self._radius = entry.wheel_radius_m
        self._half = entry.wheel_separation_m / 2
        self._command = (0.0, 0.0)
        self._driving = False

    def _read_pose(self) -> PoseMRad:
        at = self._qpos
        x, y, _, *turn = self._data.qpos[at : at + 7].tolist()
        return (x, y, yaw_of(turn))

    def put(self, pose_m_rad: PoseMRad) -> None:
        x, y, yaw = pose_m_rad
        at = self._qpos
        self._data.qpos[at : at + 3] = (x, y, 0.0)
        self._data.qpos[at + 3 : at + 7] = yaw_quaternion(yaw)
        self._pose_at = None
        self.halt()

    def speed(self) -> tuple[float, float]:
        qvel = self._data.qvel
        at = self._dof
        return (math.hypot(float(qvel[at]), float(qvel[at + 1])), abs(float(qvel[at + 5])))

    def halt(self) -> None:
        self._target = None
        self._spin = None

    def tick(self, ctrl: list[float]) -> None:
        speed, rate = self._wanted()
        old_speed, old_rate = self._command
        most = self._acceleration * PERIOD_S
        speed = old_speed + max(-most, min(most, speed - old_speed))
        most = 8.0 * most
        rate = old_rate + max(-most, min(most, rate - old_rate))
        self._command = (speed, rate)
        ctrl[self._ctrl[0]] = (speed - rate * self._half) / self._radius
        ctrl[self._ctrl[1]] = (speed + rate * self._half) / self._radius

    def _wanted(self) -> tuple[float, float]:
        if self._spin is not None:
            return 0.0, self._limited(self._spin)
        if self._target is None:
            return 0.0, 0.0
        x, y, yaw = self.pose()
        to_x, to_y, to_yaw, limit = self._target
        dx, dy = to_x - x, to_y - y
        distance = math.hypot(dx, dy)
        # Leaving again only from farther off keeps it from hunting around the point.
        self._driving = distance > (NEAR_M if self._driving else LEAVES_M)
        if not self._driving:
            error = 0.0 if to_yaw is None else wrap(to_yaw - yaw)
            return 0.0, self._approach_rate(error) if abs(error) > 0.01 else 0.0
        error = wrap(math.atan2(dy, dx) - yaw)
        backwards = abs(error) > math.pi / 2 and distance < 0.12
        if backwards:
            error = wrap(error + math.pi)
        rate = self._approach_rate(error)
        if abs(error) > 0.6:
            return 0.0, rate
        speed = self._approach_speed(distance, limit) * max(0.0, math.cos(1.5 * error))
        return (-speed if backwards else speed), rate


class Turret(Drive):
    """A base that does not drive: it turns about the vertical where it stands."""

    def __init__(self, model: Any, data: Any, prefix: str, entry: FixedBase) -> None:
        super().__init__(data, 0.0, 0.8, entry.yaw_rate_rad_s)
        joint = model.joint(prefix + entry.joint)
        self._qpos, self._dof = int(joint.qposadr[0]), int(joint.dofadr[0])
        self._ctrl = int(model.actuator(prefix + entry.actuator).id)
        body = model.body(int(joint.bodyid[0]))
        self._at = (float(body.pos[0]), float(body.pos[1]))
        self._command = 0.0

    def _read_pose(self) -> PoseMRad:
        return (*self._at, wrap(float(self._data.qpos[self._qpos])))

    def put(self, pose_m_rad: PoseMRad) -> None:
        self._data.qpos[self._qpos] = pose_m_rad[2]
        self._pose_at = None
        self.halt()

    def speed(self) -> tuple[float, float]:
        return (0.0, abs(float(self._data.qvel[self._dof])))

    def tick(self, ctrl: list[float]) -> None:
        if self._target is None:
            self.halt()
        assert self._target is not None
        yaw = self.pose()[2]
        to_yaw = self._target[2]
        rate = self._approach_rate(0.0 if to_yaw is None else wrap(to_yaw - yaw))
        rate = rate if self._spin is None else self._limited(self._spin)
        most = 3.0 * self._acceleration * PERIOD_S
        self._command += max(-most, min(most, rate - self._command))
        ctrl[self._ctrl] = self._command


def make_drive(
    model: Any, data: Any, prefix: str, description: Description, speed_m_s: float
) -> Drive:
    """The controller for the kind of base that the description names."""
    base = description.base
    if isinstance(base, FixedBase):
        return Turret(model, data, prefix, base)
    if isinstance(base, PlanarDrive):
        return Planar(model, data, prefix, base, speed_m_s)
    return Differential(model, data, prefix, base, speed_m_s)
