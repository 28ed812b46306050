"""What a robot's driver can be told to do, and what it says back; the same for every embodiment.

Metres and radians in the world frame (x east, y north, z up); seconds on the fleet's clock
(simulated time in a simulation).
"""

from __future__ import annotations

from enum import Enum

from keyexpr_schema.facts import Value
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Payload
from keyexpr_schema.payloads.robots import PoseMRad

PointM = tuple[float, float, float]
"""`(x, y, z)` [m], world frame."""


class MotionKind(str, Enum):
    """What a robot's driver can be told to do.

    go_to             drive to a free spot inside `place`
    look              look around from here; the outcome lists what was seen
    approach          drive to where the hand reaches `point_m` (a robot without a hand: next to it)
    grasp             close the hand on `object` near `point_m` and lift it
    release           set the held object down at `point_m` (the point its base shall touch)
    release_in_basket let the held object down into the basket of `robot`
    stow              fold the arm into its carrying pose
    place_at          drive up to the thing `object` and set what is held down on it or in it
    hand_over         drive up to the person `object` and give what is held into that one's hand
    open, close       drive up to the thing `object` and open or close it by its handle
    switch_on, switch_off
                      drive up to the thing `object` and touch its switch, unless it is so already
    charge            dock at the charger `object` until the battery is full
    """

    GO_TO = "go_to"
    LOOK = "look"
    APPROACH = "approach"
    GRASP = "grasp"
    RELEASE = "release"
    RELEASE_IN_BASKET = "release_in_basket"
    STOW = "stow"
    PLACE_AT = "place_at"
    HAND_OVER = "hand_over"
    OPEN = "open"
    CLOSE = "close"
    SWITCH_ON = "switch_on"
    SWITCH_OFF = "switch_off"
    CHARGE = "charge"


class Motion(Payload, frozen=True, kw_only=True):
    """One command to a robot's driver."""

    kind: MotionKind
    place: Id | None = None
    object: Id | None = None
    robot: Id | None = None
    point_m: PointM | None = None
    timeout_s: float = 120.0


class Detection(Payload, frozen=True, kw_only=True):
    """Something a robot sees from where it stands."""

    object: Id
    kind: Id
    point_m: PointM
    """Centre of the object's base; of furniture, where one comes up to it to look into it."""
    place: Id | None = None
    support: str = "floor"
    """What it lies on or in directly: `floor`, a surface, a thing, or a robot (in its basket)."""
    states: dict[Id, Value] = {}
    """What can be seen of its states: `is_open`, `is_on`, and those that processes change."""


class Senses(Payload, frozen=True, kw_only=True):
    """What a robot knows of itself without looking: odometry, hand and basket sensors, and how full
    its battery is [%], where it has one. `basket_sensor`: whether the basket has one, so that what
    `basket` does not name is not in it."""

    robot: Id
    time_s: float
    pose_m_rad: PoseMRad
    place: Id | None
    holding: Id | None = None
    basket: tuple[Id, ...] = ()
    basket_sensor: bool = False
    moving: bool = False
    charge: float | None = None


class MotionState(str, Enum):
    """How a motion stands."""

    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    STOPPED = "stopped"


class MotionOutcome(Payload, frozen=True, kw_only=True):
    """How a motion stands or ended. `reason` is a sentence where it failed or was stopped.

    `blocked_by` is a thing that is in the way, and would not be if it were closed. `retryable` says
    whether trying again here and now could help: not where the robot is too large, or too short.
    """

    state: MotionState
    senses: Senses
    reason: str | None = None
    detections: tuple[Detection, ...] = ()
    blocked_by: Id | None = None
    retryable: bool = True
