"""From the nodes a robot was promised to what its velocity controller needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from keyexpr_schema.payloads.robots import PoseMRad

DECELERATION_M_S2 = 0.5
CORNER_M_S = 0.3
"""Speed at which a robot takes a turn of 45 degrees or more."""

NEAR_M = 0.06
"""A node counts as reached at this distance; what lies behind is given up."""

CUT_M = 0.10
"""A robot heads for the next node but one from here on: turns are rounded by some 4 cm."""

STAND_M = 0.03
STAND_RAD = 0.06
"""How exactly a robot stands at the end of its way."""

XY = tuple[float, float]


def braking_m(speed_m_s: float) -> float:
    """In what way a robot comes to rest."""
    return speed_m_s**2 / (2 * DECELERATION_M_S2)


class Leg(NamedTuple):
    """What one robot shall do now.

    Drive straight towards `target_m` (world frame, m) at `speed_limit_m_s`, which already brakes
    for turns and for the end of the space reserved for it. `yaw_rad`: the direction to face, or
    `None` where it does not matter on the way. `arrived`: it is where it was sent, or was sent
    nowhere; it still has to hold `target_m`, which moves when it is asked to make way. `failed`
    says in a sentence why it will not arrive.
    """

    target_m: XY
    yaw_rad: float | None
    speed_limit_m_s: float
    arrived: bool
    failed: str | None


def passed(here_m: XY, track: Sequence[Sequence[float]]) -> bool:
    """Whether the second of up to three nodes of a track is reached, or already left behind."""
    node = track[1]
    gap = math.dist(here_m, node)
    if gap <= NEAR_M:
        return True
    if len(track) < 3 or gap > 2.5 * CUT_M:
        return False
    dx, dy = track[2][0] - node[0], track[2][1] - node[1]
    length = math.hypot(dx, dy)
    rx, ry = here_m[0] - node[0], here_m[1] - node[1]
    along, across = (rx * dx + ry * dy) / length, abs(ry * dx - rx * dy) / length
    return along > 0.0 and across <= CUT_M


def steer(
    pose_m_rad: PoseMRad,
    ahead_m: Sequence[XY],
    *,
    on_line: bool,
    yaw_rad: float | None,
    speed_m_s: float,
    failed: str | None,
) -> Leg:
    """The leg of a robot that may drive along `ahead_m`, whose first point it is at or comes from.

    `on_line`: it is on the lattice, between the first and the second point. `arrived` tells whether
    it stands at the end of `ahead_m` (facing `yaw_rad`, if given).
    """
    x, y, yaw = pose_m_rad
    here = (x, y)
    first = 1 if on_line and len(ahead_m) > 1 else 0
    if len(ahead_m) > first + 1 and math.dist(here, ahead_m[first]) < CUT_M:
        first += 1
    last = first
    while last + 1 < len(ahead_m) and _turn(here, ahead_m[last], ahead_m[last + 1]) < 0.05:
        last += 1
    target = ahead_m[last]
    gap = math.dist(here, target)
    end = gap + sum(
        math.dist(a, b) for a, b in zip(ahead_m[last:], ahead_m[last + 1 :], strict=False)
    )
    limit = min(speed_m_s, math.sqrt(2 * DECELERATION_M_S2 * end), 2.5 * end)
    if last + 1 < len(ahead_m):
        corner = math.sqrt(CORNER_M_S**2 + 2 * DECELERATION_M_S2 * gap)
        limit = min(limit, corner)
    there = last + 1 == len(ahead_m) and gap <= STAND_M
    if there and yaw_rad is not None:
        there = abs(math.remainder(yaw_rad - yaw, math.tau)) <= STAND_RAD
    return Leg(target, yaw_rad, limit, there, failed)


def _turn(a: XY, b: XY, c: XY) -> float:
    """How far the way from `a` over `b` to `c` bends, rad."""
    into = math.atan2(b[1] - a[1], b[0] - a[0])
    out = math.atan2(c[1] - b[1], c[0] - b[0])
    return abs(math.remainder(out - into, math.tau))
