"""Robots that are points: they follow a navigator's legs, without physics."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim.navigation import Leg

PERIOD_S = 0.05


@dataclass
class PointRobot:
    """A robot with a footprint: holonomic, or with two driven wheels."""

    pose: tuple[float, float, float]
    radius_m: float = 0.25
    speed_m_s: float = 0.6
    holonomic: bool = True

    def follow(self, leg: Leg) -> None:
        """Move for one control period as the leg says."""
        x, y, yaw = self.pose
        dx, dy = leg.target_m[0] - x, leg.target_m[1] - y
        gap = math.hypot(dx, dy)
        assert leg.speed_limit_m_s <= self.speed_m_s + 1e-9
        step = min(gap, leg.speed_limit_m_s * PERIOD_S)
        heading = math.atan2(dy, dx)
        if self.holonomic:
            x, y = x + step * math.cos(heading), y + step * math.sin(heading)
            want = leg.yaw_rad
        elif gap > 0.02:
            want = heading
            if abs(math.remainder(heading - yaw, math.tau)) < 0.15:
                x, y = x + step * math.cos(yaw), y + step * math.sin(yaw)
        else:
            want = leg.yaw_rad
        if want is not None:
            yaw += max(-0.1, min(0.1, math.remainder(want - yaw, math.tau)))
        self.pose = (x, y, yaw)
