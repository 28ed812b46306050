"""Payloads between the simulated world and those who drive, watch or judge it.

Metres and radians in the world frame (x east, y north, z up); seconds of simulated time.
Quaternions are `(w, x, y, z)`.
"""

from __future__ import annotations

from enum import Enum

from keyexpr_schema.facts import Value
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload
from keyexpr_schema.payloads.motions import Motion, PointM

QuaternionWxyz = tuple[float, float, float, float]
"""An orientation, `(w, x, y, z)`."""


class SimAddress(Address, frozen=True):
    """The simulated world; there is one to a realm."""


class SimAliveAddress(Address, frozen=True):
    """One run of a simulated world."""

    incarnation: str


class SimRobotAddress(Address, frozen=True):
    """One simulated robot."""

    robot: str


class TruthAddress(Address, frozen=True):
    """One simulated object."""

    object: str


class MotionCall(Payload, frozen=True, kw_only=True):
    """Carry out `motion` once, whatever the number of times this call arrives.

    `call` names the call; the driver answers a repeated one with what became of the first.
    A new `incarnation` stops whatever an older one had begun. No `motion`: only report senses.
    `stop` stops the named call; the robot brakes. With a name of its own it stops whatever runs,
    and the robot stays where it is, whoever wants to get past, until its next motion or a call
    with `release`. The reply comes when motion and robot have come to rest, or after `wait_s`
    seconds of wall time.
    """

    call: Id
    incarnation: Id
    motion: Motion | None = None
    stop: bool = False
    wait_s: float = 1.0
    release: bool = False


class SimClock(Payload, frozen=True, kw_only=True):
    """Simulated time, and the wall time (Unix seconds) at which it was that."""

    time_s: float
    wall_time_s: float
    speed: float | None
    """Simulated seconds a second; `None` is as fast as possible."""


class Truth(Payload, frozen=True, kw_only=True):
    """Where an object really is: for judging and recording, never for planning.

    `support` is what carries it directly: `floor`, a surface, a thing that it is on or in, a person
    who has it, a robot (in its basket), or `None` in mid-air. `states` are how it is: `is_open` and
    `is_on` of what opens and what is switched, and what processes have made of it.
    """

    object: Id
    kind: Id
    time_s: float
    point_m: PointM
    place: Id | None
    support: str | None
    held_by: Id | None
    settled: bool
    states: dict[Id, Value] = {}


class ShapeKind(str, Enum):
    """Shapes a viewer can draw."""

    BOX = "box"
    CYLINDER = "cylinder"
    SPHERE = "sphere"
    CAPSULE = "capsule"


class Shape(Payload, frozen=True, kw_only=True):
    """A coloured solid fixed to a body, in the body's frame.

    `size_m`: box half-extents (x, y, z); cylinder and capsule (radius, half-length along z, 0);
    sphere (radius, 0, 0).
    """

    kind: ShapeKind
    size_m: PointM
    point_m: PointM
    quaternion_wxyz: QuaternionWxyz
    rgba: tuple[float, float, float, float]


class Body(Payload, frozen=True, kw_only=True):
    """A rigid body that a viewer draws; `owner` is the robot or object it belongs to."""

    body: str
    owner: Id | None
    shapes: tuple[Shape, ...]


class Scene(Payload, frozen=True, kw_only=True):
    """What does not change: every body's shapes, and the pose of those that never move."""

    world: Id
    bodies: tuple[Body, ...]
    fixed: dict[str, tuple[PointM, QuaternionWxyz]]


class Frame(Payload, frozen=True, kw_only=True):
    """Where every movable body is: position (m) and orientation (w, x, y, z), by body."""

    time_s: float
    poses: dict[str, tuple[PointM, QuaternionWxyz]]


class Frames(Payload, frozen=True, kw_only=True):
    """Frames in a row, oldest first: a fast simulation makes more than there are messages for."""

    frames: tuple[Frame, ...]


class ContactCount(Payload, frozen=True, kw_only=True):
    """Robots that ran into each other or into walls since the start; each touch counted once."""

    time_s: float
    robot_robot: int
    robot_wall: int
