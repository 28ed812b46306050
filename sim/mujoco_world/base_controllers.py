"""Base controllers: from a target point to velocity commands, once a control period."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

from keyexpr_schema.payloads.robots import PoseMRad
from sim.files.furniture_schema import PointXY
from sim.mujoco_world.description import PlanarDrive

PERIOD_S = 0.05
"""Control period."""

GAIN_1_S = 3.0
"""Speed commanded for each metre of distance: settles in about a second, below the servo's band."""

YAW_GAIN_1_S = 4.0

CARRYING_RAD_S = 0.5
"""Turning rate with something in the hand. Friction has no memory of place: in a turn, each physics
step of `dt` leaves a held object `(rate * dt)**2 * radius / 2` farther out, here 0.13 mm/s."""


STANDS_M_S, STANDS_RAD_S = 0.005, 0.01
"""A base slower than this stands."""


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
        self.backs = False
        """Whether it may drive any distance backwards, to a target behind it."""
        self._target: tuple[float, float, float | None, float] | None = None
        self._spin: float | None = None
        self._braking = False
        self._pose_at: tuple[float, PoseMRad] | None = None

    def pose(self) -> PoseMRad:
        """Where the base is: (x, y, yaw), world frame; read once for each moment."""
        now_s = self._data.time
        if self._pose_at is None or self._pose_at[0] != now_s:
            self._pose_at = (now_s, self._read_pose())
        return self._pose_at[1]

    @abstractmethod
    def _read_pose(self) -> PoseMRad: ...

    def put(self, pose_m_rad: PoseMRad) -> None:
        """Set the starting pose (before the simulation runs; nothing is ever moved so after)."""
        self.write_pose(self._data, pose_m_rad)
        self._pose_at = None
        self.halt()

    @abstractmethod
    def write_pose(self, data: Any, pose_m_rad: PoseMRad) -> None:
        """Put the base there in `data`, which need not be the world's own."""

    @abstractmethod
    def speed(self) -> tuple[float, float]:
        """How fast it moves: m/s, rad/s (both not negative)."""

    @abstractmethod
    def _commanded(self) -> tuple[float, float]:
        """How fast its motors are told to move it: m/s, rad/s (both not negative)."""

    def stands(self) -> bool:
        """Whether it does not move, and its motors are not told to."""
        told, does = self._commanded(), self.speed()
        return max(told[0], does[0]) < STANDS_M_S and max(told[1], does[1]) < STANDS_RAD_S

    @abstractmethod
    def tick(self, ctrl: list[float]) -> None:
        """Write the commands for the next control period."""

    def drive(
        self,
        x_m: float,
        y_m: float,
        yaw_rad: float | None,
        speed_m_s: float | None = None,
        *,
        backs: bool = False,
    ) -> None:
        """Go to a point, facing `yaw_rad` in the end (`None`: whatever comes).

        `backs`: straight on, backwards if that is behind.
        """
        limit = self._top_m_s if speed_m_s is None else min(self._top_m_s, speed_m_s)
        self._spin, self._braking = None, False
        self.backs = backs
        self._target = (x_m, y_m, yaw_rad, limit)

    @abstractmethod
    def lead(self, point_m: PointXY, ahead_m: float, speed_m_s: float) -> None:
        """Move so that the point `ahead_m` before its axis comes to `point_m`."""

    @abstractmethod
    def led(self, way_m: Sequence[PointXY], ahead_m: float) -> list[PoseMRad]:
        """Where the base gets to as it is led along a way, from where it is now."""

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
        self._spin, self._braking = rate_rad_s, False

    def halt(self) -> None:
        """Stay here: back to here, where it still moves."""
        x, y, yaw = self.pose()
        self._spin, self._braking = None, False
        self._target = (x, y, yaw, self._top_m_s)

    def brake(self) -> None:
        """Come to rest as soon as it can, and stay there."""
        self.halt()
        self._braking = True

    def _brakes(self) -> bool:
        """Whether it is still braking."""
        if self._braking and self.stands():
            self.halt()
        return self._braking

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

    def write_pose(self, data: Any, pose_m_rad: PoseMRad) -> None:
        data.qpos[self._qpos] = pose_m_rad

    def lead(self, point_m: PointXY, ahead_m: float, speed_m_s: float) -> None:
        if self._target is None or self._target[2] is None:
            self.halt()
        assert self._target is not None
        yaw = self._target[2]
        assert yaw is not None
        x, y = point_m[0] - ahead_m * math.cos(yaw), point_m[1] - ahead_m * math.sin(yaw)
        self.drive(x, y, yaw, speed_m_s)

    def led(self, way_m: Sequence[PointXY], ahead_m: float) -> list[PoseMRad]:
        yaw = self.pose()[2]
        c, s = ahead_m * math.cos(yaw), ahead_m * math.sin(yaw)
        return [(x - c, y - s, yaw) for x, y in way_m]

    def speed(self) -> tuple[float, float]:
        vx, vy, rate = (float(self._data.qvel[address]) for address in self._dofs)
        return (math.hypot(vx, vy), abs(rate))

    def _commanded(self) -> tuple[float, float]:
        vx, vy, rate = self._command
        return (math.hypot(vx, vy), abs(rate))

    def tick(self, ctrl: list[float]) -> None:
        vx, vy, rate = (0.0, 0.0, 0.0) if self._brakes() else self._wanted()
        old_x, old_y, old_rate = self._command
        vx, vy = _turned_into((old_x, old_y), (vx, vy), self._acceleration * PERIOD_S)
        most = 3.0 * self._acceleration * PERIOD_S
        rate = old_rate + max(-most, min(most, rate - old_rate))
        self._command = (vx, vy, rate)
        for motor, value in zip(self._ctrl, self._command, strict=True):
            ctrl[motor] = value

    def _wanted(self) -> tuple[float, float, float]:
        """The velocity that leads to the target: m/s along x and y, rad/s."""
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
        return vx, vy, rate


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
