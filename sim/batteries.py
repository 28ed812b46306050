"""Batteries of simulated robots: the same in every backend, by simulated time alone."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from enum import Enum
from math import inf

from keyexpr_schema.payloads.robots import FULL, Battery, RobotSpec

JUST_FULL = 1e-6
"""What is missing of a full battery when it counts as full [%]."""


class Use(Enum):
    """What a robot does with its battery."""

    IDLE = "idle"
    DRIVING = "driving"
    WORKING = "working"
    CHARGING = "charging"


def power_w(battery: Battery, use: Use) -> float:
    """What comes into the battery [W]; below 0 what goes out of it."""
    return {
        Use.IDLE: -battery.idle_w,
        Use.DRIVING: -battery.driving_w,
        Use.WORKING: -battery.working_w,
        Use.CHARGING: battery.charging_w,
    }[use]


class Batteries:
    """The batteries of all robots that have one, and how full they are [%]."""

    def __init__(self, robots: Iterable[RobotSpec], charge: Mapping[str, float] = {}) -> None:
        """Full at first, but where `charge` says otherwise [%]."""
        self._batteries = {spec.robot: spec.battery for spec in robots if spec.battery is not None}
        self._charge = {robot: charge.get(robot, FULL) for robot in self._batteries}

    def charge(self, robot: str) -> float | None:
        """How full a robot's battery is [%]; `None`: it has none, and never runs out."""
        return self._charge.get(robot)

    def set_charge(self, robot: str, percent: float) -> None:
        """Exchange a robot's battery for one that is so full [%]."""
        if robot in self._charge:
            self._charge[robot] = min(max(percent, 0.0), FULL)

    def is_empty(self, robot: str) -> bool:
        """Whether nothing is left."""
        return self._charge.get(robot, FULL) <= 0.0

    def is_full(self, robot: str) -> bool:
        """Whether it takes no more; so does the one of a robot that has none."""
        return self._charge.get(robot, FULL) >= FULL - JUST_FULL

    def battery(self, robot: str) -> Battery | None:
        """What a robot has, if it has one."""
        return self._batteries.get(robot)

    def lasts_s(self, use: Callable[[str], Use]) -> float:
        """After how long, if all go on with what they do, one that is not yet is empty [s]."""
        left_s = inf
        for robot, battery in self._batteries.items():
            charge, power = self._charge[robot], power_w(battery, use(robot))
            if charge > 0.0 and power < 0.0:
                left_s = min(left_s, battery.energy_wh(charge) / -power * 3600.0)
        return left_s

    def advance(self, seconds: float, use: Callable[[str], Use]) -> tuple[str, ...]:
        """Let so much time pass; the robots whose batteries have run empty in it."""
        emptied = []
        for robot, battery in self._batteries.items():
            before = self._charge[robot]
            change = battery.percent(power_w(battery, use(robot)) * seconds / 3600.0)
            self._charge[robot] = min(max(before + change, 0.0), FULL)
            if before > 0.0 and self._charge[robot] <= JUST_FULL:
                self._charge[robot] = 0.0
                emptied.append(robot)
        return tuple(emptied)
