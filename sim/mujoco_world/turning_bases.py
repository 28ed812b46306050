"""Bases that turn: on two driven wheels, or on a column that stands still."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from keyexpr_schema.payloads.robots import PoseMRad
from sim.files.furniture_schema import PointXY
from sim.mujoco_world.assemble import yaw_of, yaw_quaternion
from sim.mujoco_world.base_controllers import PERIOD_S, Drive, Planar, wrap
from sim.mujoco_world.description import Description, DifferentialDrive, FixedBase, PlanarDrive

NEAR_M = 0.015
"""A wheeled base this close to its target has arrived; turning on the spot for less is noise."""

LEAVES_M = 0.025

LEAD_GAIN_1_S = 4.0
LED_STEPS = 4
STEADY_RAD = 0.004
"""A wheeled base this close to its heading does not turn any more."""


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
        self._lead: tuple[PointXY, float, float] | None = None

    def _read_pose(self) -> PoseMRad:
        at = self._qpos
        x, y, _, *turn = self._data.qpos[at : at + 7].tolist()
        return (x, y, yaw_of(turn))

    def write_pose(self, data: Any, pose_m_rad: PoseMRad) -> None:
        x, y, yaw = pose_m_rad
        at = self._qpos
        data.qpos[at : at + 3] = (x, y, 0.0)
        data.qpos[at + 3 : at + 7] = yaw_quaternion(yaw)

    def speed(self) -> tuple[float, float]:
        qvel = self._data.qvel
        at = self._dof
        return (math.hypot(float(qvel[at]), float(qvel[at + 1])), abs(float(qvel[at + 5])))

    def _commanded(self) -> tuple[float, float]:
        speed, rate = self._command
        return (abs(speed), abs(rate))

    def halt(self) -> None:
        self._target = self._lead = None
        self._spin = None

    def drive(
        self,
        x_m: float,
        y_m: float,
        yaw_rad: float | None,
        speed_m_s: float | None = None,
        *,
        backs: bool = False,
    ) -> None:
        self._lead = None
        super().drive(x_m, y_m, yaw_rad, speed_m_s, backs=backs)

    def spin(self, rate_rad_s: float) -> None:
        self._lead = None
        super().spin(rate_rad_s)

    def lead(self, point_m: PointXY, ahead_m: float, speed_m_s: float) -> None:
        self._lead, self._spin = (point_m, ahead_m, speed_m_s), None

    def led(self, way_m: Sequence[PointXY], ahead_m: float) -> list[PoseMRad]:
        _, _, yaw = self.pose()
        found = []
        at = way_m[0]
        for to in way_m:
            for k in range(1, LED_STEPS + 1):
                x, y = (a + (b - a) * k / LED_STEPS for a, b in zip(at, to, strict=True))
                step = (to[0] - at[0]) / LED_STEPS, (to[1] - at[1]) / LED_STEPS
                yaw += (math.cos(yaw) * step[1] - math.sin(yaw) * step[0]) / ahead_m
            at = to
            found.append((x - ahead_m * math.cos(yaw), y - ahead_m * math.sin(yaw), yaw))
        return found

    def _led(self, point_m: PointXY, ahead_m: float, limit_m_s: float) -> tuple[float, float]:
        """Speed and turning rate that bring the point before the axis to where it shall be: along
        the heading the base drives, across it the base turns.
        """
        x, y, yaw = self.pose()
        c, s = math.cos(yaw), math.sin(yaw)
        dx, dy = point_m[0] - x - ahead_m * c, point_m[1] - y - ahead_m * s
        distance = math.hypot(dx, dy)
        share = min(limit_m_s, LEAD_GAIN_1_S * distance) / distance if distance > 1e-6 else 0.0
        return share * (c * dx + s * dy), share * (c * dy - s * dx) / ahead_m

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
        if self._lead is not None:
            return self._led(*self._lead)
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
            return 0.0, self._approach_rate(error) if abs(error) > STEADY_RAD else 0.0
        error = wrap(math.atan2(dy, dx) - yaw)
        backwards = abs(error) > math.pi / 2 and (self.backs or distance < 0.12)
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

    def write_pose(self, data: Any, pose_m_rad: PoseMRad) -> None:
        data.qpos[self._qpos] = pose_m_rad[2]

    def lead(self, point_m: PointXY, ahead_m: float, speed_m_s: float) -> None:
        self.halt()

    def led(self, way_m: Sequence[PointXY], ahead_m: float) -> list[PoseMRad]:
        return [self.pose()]

    def speed(self) -> tuple[float, float]:
        return (0.0, abs(float(self._data.qvel[self._dof])))

    def _commanded(self) -> tuple[float, float]:
        return (0.0, abs(self._command))

    def tick(self, ctrl: list[float]) -> None:
        if self._target is None:
            self.halt()
        assert self._target is not None
        yaw = self.pose()[2]
        to_yaw = self._target[2]
        rate = self._approach_rate(0.0 if to_yaw is None else wrap(to_yaw - yaw))
        rate = rate if self._spin is None else self._limited(self._spin)
        if self._brakes():
            rate = 0.0
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
