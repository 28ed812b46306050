"""Poses of moving bodies: collected by body, and sent many at a time."""

from __future__ import annotations

from dataclasses import dataclass, field

import rerun as rr

from fleet.timeline.drawing.sink import ROWS, Sink, entity
from keyexpr_schema.payloads.motions import PointM
from keyexpr_schema.payloads.simulation import QuaternionWxyz

POSES = 64
"""So many poses of one body are worth a piece of the file of their own."""

_STILL_M = 0.0005
_STILL_QUATERNION = 0.0005

Pose = tuple[PointM, QuaternionWxyz]


@dataclass
class _Column:
    """Poses of one body that wait to be sent, and the last one that was taken."""

    path: str
    last: Pose | None = None
    sim_s: list[float] = field(default_factory=list)
    wall_s: list[float] = field(default_factory=list)
    points: list[PointM] = field(default_factory=list)
    quaternions: list[tuple[float, float, float, float]] = field(default_factory=list)  # x y z w


class Poses:
    """Transforms of bodies in the world frame, `world/bodies/{owner}/{body}`."""

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self._columns: dict[str, _Column] = {}
        self._first: dict[str, tuple[float, Pose]] = {}
        """Of each entity where it was first seen, and from when on [s, fleet time] it is there."""

    def clear(self) -> None:
        """Forget all bodies, and what of them was not sent."""
        self._columns.clear()

    def last(self, body: str) -> Pose | None:
        """The last pose that was taken of a body."""
        column = self._columns.get(body)
        return None if column is None else column.last

    def take(self, body: str, owner: str, pose: Pose, sim_s: float, wall_s: float) -> None:
        """The body of `owner` is there; nothing to record if it did not move."""
        column = self._columns.get(body)
        if column is None:
            column = self._columns[body] = _Column(entity("world", "bodies", owner, body))
        if column.last is not None and _still(column.last, pose):
            return
        column.last = pose
        self._first.setdefault(column.path, (sim_s, pose))
        point, (w, x, y, z) = pose
        column.sim_s.append(sim_s)
        column.wall_s.append(wall_s)
        column.points.append(point)
        column.quaternions.append((x, y, z, w))
        if len(column.sim_s) >= ROWS:
            self._send(column)

    def flush(self, at_least: int = 1) -> None:
        """Send the poses that wait, of bodies with `at_least` so many."""
        for column in self._columns.values():
            if len(column.sim_s) >= at_least:
                self._send(column)
        begun = self._sink.begun
        for path, (since_s, pose) in self._first.items():
            if begun is not None and begun[0] < since_s:
                self._first[path] = begun[0], pose
                self._stand(path, pose, *begun)

    def _stand(self, path: str, pose: Pose, sim_s: float, wall_s: float) -> None:
        """Let a body be from the beginning on where it was first seen, and not in a corner."""
        point, (w, x, y, z) = pose
        there = rr.Transform3D.columns(translation=[point], quaternion=[(x, y, z, w)])
        self._sink.columns(path, [sim_s], [wall_s], there)

    def _send(self, column: _Column) -> None:
        self._sink.columns(
            column.path,
            column.sim_s,
            column.wall_s,
            rr.Transform3D.columns(translation=column.points, quaternion=column.quaternions),
        )
        column.sim_s, column.wall_s, column.points, column.quaternions = [], [], [], []


def _still(last: Pose, now: Pose) -> bool:
    if last == now:
        return True
    moved = max(abs(a - b) for a, b in zip(last[0], now[0], strict=True))
    turned = max(abs(a - b) for a, b in zip(last[1], now[1], strict=True))
    return moved < _STILL_M and turned < _STILL_QUATERNION
