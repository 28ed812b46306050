"""Payloads about robots. Poses are `(x [m], y [m], yaw [rad])` in the world frame."""

from __future__ import annotations

from enum import Enum

from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload

PoseMRad = tuple[float, float, float]
"""`(x [m], y [m], yaw [rad])`, world frame."""


class RobotAddress(Address, frozen=True):
    """One robot."""

    robot: str


class AliveAddress(Address, frozen=True):
    """One run of one robot's worker."""

    robot: str
    incarnation: str


class RobotSpec(Payload, frozen=True, kw_only=True):
    """What a robot is and can do; declared once by whoever registers it.

    `skills` names the skills its worker carries out; `capabilities` what its body offers, with a
    parameter each (`grip: 1.2` is a payload in kg, `reach: 1.0` a height in m, `basket: 2` a
    number of objects, `drive: 0.5` a speed in m/s, `see: 4.0` a range in m).
    """

    robot: Id
    model: Id
    label: str = ""
    skills: tuple[Id, ...]
    capabilities: dict[str, float]
    by: str = ""
    """Who registered it, such as `ana@lab`."""


class RobotActivity(str, Enum):
    """What a worker is doing."""

    IDLE = "idle"
    BUSY = "busy"
    RECOVERING = "recovering"
    STOPPED = "stopped"


class RobotState(Payload, frozen=True, kw_only=True):
    """What a worker observes of its own robot.

    `stops` are the emergency stops that it obeys: it has come to rest, and stays there.
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


class Alive(Payload, frozen=True, kw_only=True):
    """Liveliness tokens carry no value; this type stands in the key table for them."""
