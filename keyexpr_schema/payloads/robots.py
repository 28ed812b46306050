"""Payloads about robots. Poses are `(x [m], y [m], yaw [rad])` in the world frame."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Annotated

import msgspec

from keyexpr_schema.authors import Author
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, NamedAddress, Payload
from keyexpr_schema.payloads.waits import WaitReason

PoseMRad = tuple[float, float, float]
"""`(x [m], y [m], yaw [rad])`, world frame."""


class RobotAddress(NamedAddress, frozen=True):
    """One robot."""

    robot: str


class AliveAddress(Address, frozen=True):
    """One run of one robot's worker."""

    robot: str
    incarnation: str


Watts = Annotated[float, msgspec.Meta(ge=0.0)]
FULL = 100.0
"""A full battery's charge [% of its capacity]."""


class Battery(msgspec.Struct, frozen=True, kw_only=True):
    """What a robot's battery holds, and how fast it runs down and fills.

    It draws `working_w` while its robot carries out a motion, `driving_w` while that drives, and
    `idle_w` all the other time; at a charger it gains `charging_w`. Below `reserve_percent` of the
    capacity the robot is sent to charge.
    """

    capacity_wh: Annotated[float, msgspec.Meta(gt=0.0)]
    idle_w: Watts
    driving_w: Watts
    working_w: Watts
    charging_w: Annotated[float, msgspec.Meta(gt=0.0)]
    reserve_percent: Annotated[float, msgspec.Meta(ge=0.0, lt=100.0)] = 20.0

    def percent(self, energy_wh: float) -> float:
        """Energy as a part of the capacity [%]."""
        return FULL * energy_wh / self.capacity_wh

    def energy_wh(self, percent: float) -> float:
        """What a charge of so many percent is in Wh."""
        return self.capacity_wh * percent / FULL

    @property
    def reserve_wh(self) -> float:
        """What is left when the robot is sent to charge."""
        return self.energy_wh(self.reserve_percent)

    def charging_s(self, from_percent: float, to_percent: float = FULL) -> float:
        """How long it takes at a charger from one charge to another [s]."""
        return max(0.0, self.energy_wh(to_percent - from_percent)) / self.charging_w * 3600.0


CHARGE_STEP = 5
"""Facts say how full batteries are in steps of so much [%]."""


def charge_step(percent: float) -> int:
    """A charge [%] as facts say it: the nearest step, but 0 only where nothing is left."""
    return CHARGE_STEP * round(percent / CHARGE_STEP) or int(percent > 0.0)


class RobotSpec(Payload, frozen=True, kw_only=True):
    """What a robot is and can do; declared once by whoever registers it.

    `skills` names the skills its worker carries out; `capabilities` what its body offers, with a
    parameter each (`grip: 1.2` is a payload in kg, `reach: 1.0` a height in m, `basket: 2` a
    number of objects, `drive: 0.5` a speed in m/s, `see: 4.0` a range in m). A robot without a
    `battery` never runs out.
    """

    robot: Id
    model: Id
    label: str = ""
    skills: tuple[Id, ...]
    capabilities: dict[str, float]
    battery: Battery | None = None
    by: Author = ""
    """Who registered it, such as `ana@lab`."""

    @property
    def offers(self) -> Mapping[str, float]:
        """What skills can need: the capabilities, and `battery` of one that has one [Wh]."""
        if self.battery is None:
            return self.capabilities
        return {**self.capabilities, "battery": self.battery.capacity_wh}


class RobotActivity(str, Enum):
    """What a worker is doing."""

    IDLE = "idle"
    BUSY = "busy"
    RECOVERING = "recovering"
    STOPPED = "stopped"


class RobotState(Payload, frozen=True, kw_only=True):
    """What a worker observes of its own robot.

    `stops` are the emergency stops that it obeys: it has come to rest, and stays there. `charge` is
    how full its battery is [%], where it has one; at 0 it stays where it is. `trouble` says in a
    sentence why the worker can begin and end no task: its disk is full, say. `clock_ahead_s` [s]:
    how far the clock of its host is ahead of that of the store's, where that is worth saying.
    `waits_for`: what keeps it from the order that it has.
    """

    robot: Id
    incarnation: Id
    activity: RobotActivity
    pose_m_rad: PoseMRad | None = None
    place: Id | None = None
    holding: Id | None = None
    basket: tuple[Id, ...] = ()
    plan: Id | None = None
    task: Id | None = None
    stops: tuple[Id, ...] = ()
    time_s: float = 0.0
    charge: float | None = None
    trouble: str | None = None
    clock_ahead_s: float = 0.0
    waits_for: tuple[WaitReason, ...] = ()


class Alive(Payload, frozen=True, kw_only=True):
    """Liveliness tokens carry no value; this type stands in the key table for them."""
